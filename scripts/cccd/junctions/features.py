"""What the network reads at nodes, links and triangles: occupancy, geometry, regions and grey values."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from cccd.junctions.complexes import REGION_GAPS_PX, Complex

__all__ = ["LINK_FEATURES", "NODE_FEATURES", "TRIANGLE_FEATURES", "Features", "measure", "normalised_grey"]

# Occupancy around a node: half width in samples, step in pixels (and the box that is averaged).
_SCALES = ((4, 1), (3, 3), (3, 9))
_GREY_STEPS = 2  # half width of the 5x5 grey patch, in samples two pixels apart
_OCCUPANCY = sum((2 * half + 1) ** 2 for half, _ in _SCALES)
_GREY = (2 * _GREY_STEPS + 1) ** 2

NODE_FEATURES = _OCCUPANCY + _GREY + 1
TRIANGLE_FEATURES = 8 + 4 * len(REGION_GAPS_PX)
LINK_FEATURES = 12 + 2 * len(REGION_GAPS_PX)


@dataclass
class Features:
    """Inputs of the network for a `Complex`.

    Attributes
    ----------
    nodes : (V, NODE_FEATURES) uint8
        Occupancy and grey patches, 255 standing for 1; zero at ring nodes.
    links : (L, LINK_FEATURES) float32
    triangles : (T, TRIANGLE_FEATURES) float32
    """

    nodes: np.ndarray
    links: np.ndarray
    triangles: np.ndarray


def normalised_grey(image: np.ndarray, pixels: np.ndarray) -> np.ndarray:
    """Give a grey slice as uint8, its 1 % and 99 % quantiles around the pixels (N, 2) at 0 and 255."""
    low = np.maximum(pixels.min(axis=0) - 12, 0)
    high = pixels.max(axis=0) + 13
    dark, bright = np.percentile(image[low[0] : high[0], low[1] : high[1]], (1, 99))
    scaled = (image - dark) * (255 / max(bright - dark, 1e-6))
    return cv2.GaussianBlur(np.clip(scaled, 0, 255).astype(np.uint8), (0, 0), 0.8)


def _patches(raster: np.ndarray, at: np.ndarray, half: int, step: int) -> np.ndarray:
    """Take samples (N, (2 half + 1)^2) of a raster around places (N, 2), zero beyond its border."""
    margin = half * step
    padded = np.pad(raster, margin)
    steps = np.arange(-half, half + 1) * step
    window = (steps[:, None] * padded.shape[1] + steps).ravel()
    centre = (at[:, 0] + margin) * padded.shape[1] + at[:, 1] + margin
    return padded.ravel()[centre[:, None] + window]


def _node_features(graph: Complex, grey: np.ndarray | None) -> np.ndarray:
    pixels = graph.points[~graph.ring].astype(np.int64)
    low = pixels.min(axis=0)
    raster = np.zeros(pixels.max(axis=0) - low + 1, np.uint8)
    raster[tuple((pixels - low).T)] = 255
    columns = []
    for half, step in _SCALES:
        # the mean over a box says how much of it is occupied; coarse boxes hold little, hence the gain
        seen = raster if step == 1 else cv2.blur(raster, (step, step), borderType=cv2.BORDER_CONSTANT)
        columns.append(
            _patches(cv2.multiply(seen, 1 if step == 1 else min(step, 4)), pixels - low, half, step)
        )
    if grey is None:
        columns.append(np.zeros((len(pixels), _GREY + 1), np.uint8))
    else:
        columns += [_patches(grey, pixels, _GREY_STEPS, 2), np.full((len(pixels), 1), 255, np.uint8)]
    nodes = np.zeros((len(graph.points), NODE_FEATURES), np.uint8)
    nodes[~graph.ring] = np.hstack(columns)
    return nodes


def _sample(grey: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Grey values in 0..1 at the pixels nearest to points (..., 2); beyond the border the border's."""
    at = np.rint(points).astype(np.int64)
    rows, columns = (np.clip(at[..., axis], 0, grey.shape[axis] - 1) for axis in (0, 1))
    return grey[rows, columns].astype(np.float32) / 255


def measure(graph: Complex, grey: np.ndarray | None = None) -> Features:
    """Measure the features of one slice.

    Parameters
    ----------
    graph : Complex
        Of a single slice.
    grey : (I, J) uint8 array or None
        From `normalised_grey`, in the pixels' coordinates.
    """
    a, b = (graph.points[graph.links[:, end]] for end in (0, 1))
    step = b - a
    length = np.hypot(step[:, 0], step[:, 1])
    angle = np.arctan2(step[:, 0], step[:, 1])
    area, outer = graph.areas, graph.outer
    corners = graph.points[graph.triangles]
    edges = np.linalg.norm(corners[:, [1, 2, 0]] - corners[:, [2, 0, 1]], axis=2)
    scales = len(REGION_GAPS_PX)
    region_area = np.empty((len(area), scales), np.float32)
    for g in range(scales):
        region_area[:, g] = np.bincount(graph.regions[:, g], np.where(outer, 0, area))[graph.regions[:, g]]
    hull_area = max(area[~outer].sum(), 1.0)
    left, right = graph.sides.T
    log_area = np.log1p(area)
    if grey is None:
        tone = np.zeros((len(area), 2), np.float32)
        across = np.zeros(len(length), np.float32)
    else:
        centre = corners.mean(axis=1, keepdims=True)
        samples = _sample(grey, np.concatenate([centre, (corners + centre) / 2], axis=1))
        tone = np.column_stack([samples.mean(axis=1) - 0.5, samples.std(axis=1)])
        normal = 1.5 * np.column_stack([-step[:, 1], step[:, 0]]) / length[:, None]
        middle = (a + b) / 2
        across = np.abs(_sample(grey, middle + normal) - _sample(grey, middle - normal))
    depth = graph.depths.astype(np.float32)
    triangles = np.column_stack(
        [
            log_area,
            np.log(edges.max(axis=1)),
            np.log(edges.min(axis=1)),
            area / edges.max(axis=1) ** 2,
            outer,
            tone,
            np.full(len(area), grey is not None),
            np.minimum(depth, 1),
            np.minimum(depth, 6) / 3,
            np.log1p(region_area) / 4,
            np.log((region_area + 1) / hull_area) / 4,
        ]
    )
    links = np.column_stack(
        [
            np.log(length),
            length <= REGION_GAPS_PX[0],
            np.cos(2 * angle),
            np.sin(2 * angle),
            np.cos(4 * angle),
            np.sin(4 * angle),
            np.minimum(log_area[left], log_area[right]),
            np.maximum(log_area[left], log_area[right]),
            np.abs(tone[left, 0] - tone[right, 0]),
            across,
            np.full(len(length), grey is not None),
            outer[left] | outer[right],
            graph.regions[left] == graph.regions[right],
            np.minimum(np.abs(depth[left] - depth[right]), 2),
        ]
    )
    return Features(_node_features(graph, grey), links.astype(np.float32), triangles.astype(np.float32))
