"""Where slices and drawn contours lie: tolerances, and even grids of uneven heights."""

from __future__ import annotations

import numpy as np

from cccd.geometry.arrays import FloatArray, IntArray

#: Contour planes may lie this share of the slice spacing away from a slice.
CONTOUR_PLANE = 0.1

#: Drawn contours may leave their plane by this share of their width; likewise 1 - cosine of directions.
SLICE_DIRECTION = 1e-3

#: Contours nearer than this along the normal lie in one plane (coordinates are written with few digits).
SAME_PLANE_MM = 0.01

#: Even grids have at most so many steps in the median gap between uneven heights.
_MOST_STEPS = 40


def even_grid(heights: FloatArray, near: float = 0.05) -> tuple[float, IntArray]:
    """Find an even grid whose nodes heights are near to, wherever they are.

    Parameters
    ----------
    heights : (P,) float64
        Two or more, ascending, apart from each other.
    near : float
        How near the nodes shall be, as a share of the median gap between heights.

    Returns
    -------
    spacing : float
        Distance of the nodes: that of the heights where it is even, also if some are missing, and a part of
        that where it is uneven.
    index : (P,) int64
        Node of each height, from 0; no two have the same.

    Examples
    --------
    >>> even_grid(np.array([0.0, 2.0, 4.0, 8.0]))
    (2.0, array([0, 1, 2, 4]))
    >>> even_grid(np.array([0.0, 2.0, 4.5, 7.5]))
    (0.625, array([ 0,  3,  7, 12]))
    """
    usual = float(np.median(np.diff(heights)))
    away = heights - heights[0]
    for steps in range(1, _MOST_STEPS + 1):
        index = np.rint(away / (usual / steps)).astype(np.int64)
        spacing = float(away[-1] / index[-1])
        index = np.rint(away / spacing).astype(np.int64)
        if np.abs(away - index * spacing).max() <= near * usual and np.diff(index).min() > 0:
            break
    return spacing, index
