"""From a boundary map and its grey slice to the graph: edges of the image help out where the map has none."""

from __future__ import annotations

import cv2
import numpy as np

from cccd.boundary import gradient_ridges
from cccd.junctions.complexes import HASHES, Complex, build_complex, pixel_hash
from cccd.junctions.features import Grey, normalised_grey

__all__ = ["image_edges", "read_map"]

# Least slope of an edge, in medians of the slice; shorter ridges than this many pixels are noise.
_LEAST_SLOPE = 1.25
_SHORTEST_PX = 4

# An edge's slope counts half at this distance from the map; at most so many edges, and per pixel of the map.
_HALF_AWAY_PX = 8.0
_MOST_EDGES = (60, 0.75)


def image_edges(grey: Grey, pixels: np.ndarray) -> np.ndarray:
    """Find places on edges of a grey slice that the map lacks.

    An edge detector with one threshold leaves out what is weak beside the strongest edges of the slice.
    Of the gradient's ridges (Canny 1986) that the map is without, about every other pixel is taken, the
    steepest and nearest first.

    Parameters
    ----------
    grey : Grey
    pixels : (N, 2) int array
        The map (i, j).

    Returns
    -------
    (E, 2) int64 array
        Pixels (i, j) in raster order, none of which touches another or the map.
    """
    shape = grey.blurred.shape
    slope, thin = (part[0] for part in gradient_ridges(grey.blurred[None], 0.0))
    ridge = (thin & (slope > _LEAST_SLOPE * np.median(slope))).astype(np.uint8)
    _, labels, stats, _ = cv2.connectedComponentsWithStats(ridge, connectivity=8)
    long = stats[:, cv2.CC_STAT_AREA] >= _SHORTEST_PX
    long[0] = False
    empty = np.ones(shape, np.uint8)
    local = pixels - grey.origin
    empty[tuple(local[((local >= 0) & (local < shape)).all(axis=1)].T)] = 0
    away = cv2.distanceTransform(empty, cv2.DIST_L2, 3)
    # steps of a hash make neighbours differ, so that of each plateau one is the largest
    strength = slope * (1 + 1e-3 / HASHES * pixel_hash(*np.indices(shape, dtype=np.int64)))
    strength = np.where(long[labels] & (away > 1.9), strength, 0).astype(np.float32)
    kept = np.zeros(shape, bool)
    around = np.ones((3, 3), np.uint8)
    for _ in range(3):  # largest first; what touches one is out
        chosen = (strength > 0) & (strength == cv2.dilate(strength, around))
        kept |= chosen
        strength[cv2.dilate(chosen.astype(np.uint8), around) > 0] = 0
    places = np.argwhere(kept)
    most = int(_MOST_EDGES[0] + _MOST_EDGES[1] * len(pixels))
    if len(places) > most:
        worth = slope[kept] * _HALF_AWAY_PX / (_HALF_AWAY_PX + away[kept])
        places = places[np.sort(np.argsort(-worth, kind="stable")[:most])]
    return places + grey.origin


def read_map(pixels: np.ndarray, image: np.ndarray | None) -> tuple[Complex, Grey | None]:
    """Triangulate a map's pixels (N, 2), and the further edges of its grey slice (I, J) if it has one."""
    if image is None:
        return build_complex(pixels), None
    grey = normalised_grey(image, pixels)
    return build_complex(pixels, image_edges(grey, pixels)), grey
