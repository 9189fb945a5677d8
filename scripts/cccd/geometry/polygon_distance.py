"""Signed distances of pixels to polygons, negative inside; compiled, as no library has them so fast."""

from __future__ import annotations

import numpy as np

from cccd.geometry._jit import jit, jit_within
from cccd.geometry.arrays import BoolArray, FloatArray, IntArray, SingleArray
from cccd.geometry.polygons import RaggedPolygons

#: Distances to polygons are exact within this many pixels of them.
NEAR_PIXELS = 2.0


def to_polygons(inside: BoolArray, polygons: RaggedPolygons, spacing: FloatArray) -> SingleArray:
    """Signed distance of every pixel (I, J) to the nearest of some polygons.

    Parameters
    ----------
    inside : (I, J) bool
        Pixels whose centres the polygons enclose.
    polygons : RaggedPolygons
        In mm from the centre of the first pixel; at least one.
    spacing : (2,) float64
        Edge lengths of a pixel in mm.

    Notes
    -----
    Pixels near a polygon find the nearest point on it; sweeps down and up the plane hand these points on, and
    each pixel keeps the nearest that it is offered (Danielsson 1980, with points between the pixels).

    Examples
    --------
    >>> square = RaggedPolygons.of([np.array([(1.0, 1), (3, 1), (3, 3), (1, 3)])])
    >>> inside = np.zeros((5, 5), bool)
    >>> inside[1:4, 1:4] = True
    >>> to_polygons(inside, square, np.ones(2))[2].tolist()
    [1.0, 0.0, -1.0, 0.0, 1.0]
    """
    foot, gap = np.full((*inside.shape, 2), np.inf), np.full(inside.shape, np.inf)
    _find_nearby(polygons.points, polygons.offsets, spacing, foot, gap)
    _sweep(foot, gap, spacing)
    away = np.sqrt(gap).astype(np.float32)
    return np.where(inside & (away > 0), -away, away)


@jit
def _sweep(foot: FloatArray, gap: FloatArray, spacing: FloatArray) -> None:
    """Hand the nearest points on, down and up the plane."""
    height = len(gap)
    for way in (1, -1):
        for step in range(height):
            i = step if way > 0 else height - 1 - step
            if 0 <= i - way < height:
                for side in (-1, 0, 1):
                    _take_over(foot, gap, i, i - way, side, spacing)
            for side in (-1, 1):
                _take_over(foot, gap, i, i, side, spacing)


@jit
def _find_nearby(
    points: FloatArray, offsets: IntArray, spacing: FloatArray, foot: FloatArray, gap: FloatArray
) -> None:
    """Write the nearest point and its squared distance, for pixels near a polygon's edges."""
    height, width = gap.shape
    for polygon in range(len(offsets) - 1):
        first, last = offsets[polygon], offsets[polygon + 1]
        for n in range(first, last):
            after = n + 1 if n + 1 < last else first
            ax, ay, bx, by = points[n, 0], points[n, 1], points[after, 0], points[after, 1]
            dx, dy = bx - ax, by - ay
            length2 = dx * dx + dy * dy
            i0 = max(0, int(np.ceil(min(ax, bx) / spacing[0] - NEAR_PIXELS)))
            i1 = min(height - 1, int(max(ax, bx) / spacing[0] + NEAR_PIXELS))
            j0 = max(0, int(np.ceil(min(ay, by) / spacing[1] - NEAR_PIXELS)))
            j1 = min(width - 1, int(max(ay, by) / spacing[1] + NEAR_PIXELS))
            for i in range(i0, i1 + 1):
                px = i * spacing[0] - ax
                for j in range(j0, j1 + 1):
                    py = j * spacing[1] - ay
                    share = 0.0
                    if length2 > 0:
                        share = min(1.0, max(0.0, (px * dx + py * dy) / length2))
                    ex, ey = px - share * dx, py - share * dy
                    if ex * ex + ey * ey < gap[i, j]:
                        gap[i, j] = ex * ex + ey * ey
                        foot[i, j, 0], foot[i, j, 1] = ax + share * dx, ay + share * dy


@jit_within
def _take_over(foot: FloatArray, gap: FloatArray, i: int, a: int, side: int, spacing: FloatArray) -> None:
    """Let the pixels of row ``i`` take over nearer points from row ``a``, ``side`` columns beside them."""
    # A row at a time, because to hand arrays on costs more than to compare two distances.
    width = gap.shape[1]
    for n in range(width - abs(side)):
        j = width - 2 - n if side > 0 else n - side
        b = j + side
        if gap[a, b] < np.inf:
            x, y = i * spacing[0] - foot[a, b, 0], j * spacing[1] - foot[a, b, 1]
            if x * x + y * y < gap[i, j]:
                gap[i, j] = x * x + y * y
                foot[i, j, 0], foot[i, j, 1] = foot[a, b, 0], foot[a, b, 1]
