"""Synthetic boundary maps with known truth: drawn afresh from a seed, and their labels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from cccd.junctions.complexes import Complex
from cccd.junctions.corruptions import KINDS, contours_of, corrupt
from cccd.junctions.greys import canny_map, draw_image
from cccd.junctions.shapes import draw_mask

__all__ = ["ALL_KINDS", "Sample", "draw_sample", "inside_shares", "link_labels", "truth_mask"]

#: Corruptions of true contours, and edge maps of grey images inside a band and without one.
ALL_KINDS = (*KINDS, "canny", "canny_whole")

# Larger maps (edge maps of noise, mostly) teach nothing and cost much.
_MOST_PIXELS = 2500

# Edge detectors blur away organs whose border is shorter.
_SHORTEST_SEEN = 60

# A sub-pixel raster this fine tells inside from outside in the half-pixel triangles between neighbours.
_SUBPIXELS = 4


@dataclass
class Sample:
    """One boundary map and the truth behind it.

    Attributes
    ----------
    pixels : (N, 2) int32
        The map's pixels (i, j) in raster order.
    contours : list of (n, 2) int32
        True borders, outer ones and holes.
    kind : str
        One of `ALL_KINDS`.
    shape : (2,) tuple of int
        Of the slice.
    image : (I, J) float32 or None
        Grey slice.
    """

    pixels: np.ndarray
    contours: list[np.ndarray]
    kind: str
    shape: tuple[int, int]
    image: np.ndarray | None = None


def draw_sample(rng: np.random.Generator, kind: str, severity: float | None = None) -> Sample:
    """Draw a mask and a boundary map of one kind; ``severity`` is drawn too when it is ``None``.

    Edge maps come with their grey slice; three in ten of the others do as well.
    """
    while True:
        mask = draw_mask(rng)
        drawn = severity if severity is not None else float(rng.uniform(0.3, 1.5))
        image = None
        contours = [contour.astype(np.int32) for contour in contours_of(mask)]
        length = sum(len(contour) for contour in contours)
        if kind.startswith("canny"):
            if length < _SHORTEST_SEEN:
                continue
            image = draw_image(rng, mask)
            band = None if kind == "canny_whole" else 6.0 if severity is not None else rng.uniform(4, 9)
            drawn_map = canny_map(rng, image, mask, band)
        else:
            drawn_map = corrupt(rng, mask, kind, drawn)
            if rng.random() < 0.3:
                image = draw_image(rng, mask)
        pixels = np.argwhere(drawn_map).astype(np.int32)
        if 0.45 * length <= len(pixels) <= _MOST_PIXELS:
            return Sample(pixels, contours, kind, mask.shape, image)


def _fill(contours: Sequence[np.ndarray], shape: Sequence[int], fine: int) -> np.ndarray:
    canvas = np.zeros([n * fine for n in shape], np.uint8)
    polygons = [(contour[:, ::-1] * fine + fine // 2).astype(np.int32) for contour in contours]
    cv2.fillPoly(canvas, polygons, 1)
    return canvas


def truth_mask(sample: Sample) -> np.ndarray:
    """Fill the true contours to a mask (I, J) uint8, their own pixels included."""
    return _fill(sample.contours, sample.shape, 1)


def inside_shares(graph: Complex, contours: Sequence[np.ndarray]) -> np.ndarray:
    """Share (T,) of every triangle's area that the true contours enclose; one slice."""
    low = np.min([contour.min(axis=0) for contour in contours], axis=0) - 1
    high = np.max([contour.max(axis=0) for contour in contours], axis=0) + 2
    canvas = _fill([contour - low for contour in contours], high - low, _SUBPIXELS)
    # centroids of the 25 equal triangles that a triangle falls into
    lower = [(3 * p + 1, 3 * q + 1) for p in range(5) for q in range(5 - p)]
    upper = [(3 * p + 2, 3 * q + 2) for p in range(4) for q in range(4 - p)]
    pq = np.array(lower + upper) / 15
    weights = np.column_stack([pq, 1 - pq.sum(axis=1)])
    corners = (graph.points - low)[graph.triangles] * _SUBPIXELS + _SUBPIXELS // 2
    i, j = (np.rint(corners[..., axis] @ weights.T).astype(np.int64) for axis in range(2))
    valid = (i >= 0) & (j >= 0) & (i < canvas.shape[0]) & (j < canvas.shape[1])
    return np.where(valid, canvas[np.where(valid, i, 0), np.where(valid, j, 0)], 0).mean(axis=1)


def link_labels(graph: Complex, shares: np.ndarray) -> np.ndarray:
    """Whether each link (L,) is part of the best border: between a triangle mostly inside and one not."""
    inside = shares > 0.5
    return inside[graph.sides[:, 0]] != inside[graph.sides[:, 1]]
