"""Sides of triangles: ``3 f + n`` runs from corner ``n`` of triangle ``f`` to its next one."""

from __future__ import annotations

import numpy as np

from cccd.geometry.arrays import BoolArray, IntArray


def opposite_sides(faces: IntArray) -> IntArray:
    """Find for each side (3 F,) the only other one along its edge, which runs the other way; else -1.

    Parameters
    ----------
    faces : (F, 3) int64

    Examples
    --------
    >>> opposite_sides(np.array([(0, 1, 2), (2, 1, 3)])).tolist()
    [-1, 3, -1, 1, -1, -1]
    """
    begin, end = faces.ravel(), faces[:, [1, 2, 0]].ravel()
    edge = np.minimum(begin, end) * (faces.max(initial=0) + 1) + np.maximum(begin, end)
    order = np.argsort(edge)
    same = np.diff(edge[order], prepend=-1, append=-1) == 0  # as the one before, for each and one more
    pair = np.flatnonzero(same[1:-1] & ~same[:-2] & ~same[2:])
    one, other = order[pair], order[pair + 1]
    opposed = begin[one] == end[other]
    opposite = np.full(len(begin), -1)
    opposite[one[opposed]], opposite[other[opposed]] = other[opposed], one[opposed]
    return opposite


def pinched_vertices(faces: IntArray, opposite: IntArray) -> BoolArray:
    """Tell vertices whose triangles do not follow each other once around them: where sheets touch, or end.

    Parameters
    ----------
    faces : (F, 3) int64
    opposite : (3 F,) int64
        Of `opposite_sides`.

    Returns
    -------
    (V,) bool
        Up to the last vertex of a triangle.
    """
    sides, begin = np.arange(len(opposite)), faces.ravel()
    degree = np.bincount(begin)
    first = np.full(len(degree), -1)
    first[begin] = sides
    around = opposite[sides - sides % 3 + (sides + 2) % 3]  # the next side that begins where this one does
    pinched, at = np.zeros(len(degree), np.bool_), np.flatnonzero(degree)
    here, steps = first[at], 0
    while len(at):
        here, steps = around[here], steps + 1
        closed = here == first[at]
        pinched[at[(closed & (degree[at] != steps)) | (here < 0)]] = True
        on = ~closed & (here >= 0)
        at, here = at[on], here[on]
    return pinched
