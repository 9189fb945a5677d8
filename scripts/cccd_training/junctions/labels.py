"""Labels of a graph's triangles and links from the true contours."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from cccd.geometry.arrays import AnyArray, BoolArray, ByteArray, FloatArray
from cccd_junctions.delaunay import DelaunayGraph

# A sub-pixel raster this fine tells inside from outside in the half-pixel triangles between neighbours.
_SUBPIXELS = 4


def fill_contours(contours: Sequence[AnyArray], shape: Sequence[int], fine: int = 1) -> ByteArray:
    """Fill contours (n, 2), their own pixels included, on a raster with ``fine`` samples to a pixel."""
    canvas = np.zeros([n * fine for n in shape], np.uint8)
    polygons = [(contour[:, ::-1] * fine + fine // 2).astype(np.int32) for contour in contours]
    cv2.fillPoly(canvas, polygons, 1)
    return canvas


def inside_shares(graph: DelaunayGraph, contours: Sequence[AnyArray]) -> FloatArray:
    """Share (T,) of every triangle's area that the true contours enclose; one slice."""
    low = np.min([contour.min(axis=0) for contour in contours], axis=0) - 1
    high = np.max([contour.max(axis=0) for contour in contours], axis=0) + 2
    canvas = fill_contours([contour - low for contour in contours], high - low, _SUBPIXELS)
    # centroids of the 25 equal triangles that a triangle falls into
    lower = [(3 * p + 1, 3 * q + 1) for p in range(5) for q in range(5 - p)]
    upper = [(3 * p + 2, 3 * q + 2) for p in range(4) for q in range(4 - p)]
    pq = np.array(lower + upper) / 15
    weights = np.column_stack([pq, 1 - pq.sum(axis=1)])
    corners = (graph.points - low)[graph.triangles] * _SUBPIXELS + _SUBPIXELS // 2
    i, j = (np.rint(corners[..., axis] @ weights.T).astype(np.int64) for axis in range(2))
    valid = (i >= 0) & (j >= 0) & (i < canvas.shape[0]) & (j < canvas.shape[1])
    return np.where(valid, canvas[np.where(valid, i, 0), np.where(valid, j, 0)], 0).mean(axis=1)


def link_labels(graph: DelaunayGraph, shares: FloatArray) -> BoolArray:
    """Whether each link (L,) is part of the best border: between a triangle mostly inside and one not."""
    inside = shares > 0.5
    return inside[graph.link_triangles[:, 0]] != inside[graph.link_triangles[:, 1]]
