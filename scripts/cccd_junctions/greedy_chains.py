"""What breaks a greedy chain code: junctions and isolated corners."""

from __future__ import annotations

import numpy as np

from cccd.chaincode import DIRECTIONS
from cccd.containers import Boundaries
from cccd.geometry._jit import jit
from cccd.geometry.arrays import BoolArray, IntArray, owners_of


def _neighbours(boundaries: Boundaries) -> IntArray:
    """Index (P, 8) of each boundary pixel's neighbours by Freeman code; -1 where there is none."""
    points = boundaries.points.astype(np.int64)
    if len(points) == 0:
        return np.zeros((0, 8), np.int64)
    points = points - points.min(axis=0) + 1
    height, width = points.max(axis=0) + 2
    layer = owners_of(boundaries.offsets)
    key: IntArray = (layer * height + points[:, 0]) * width + points[:, 1]
    order = np.argsort(key, kind="stable")
    wanted = np.asarray(key[:, None] + DIRECTIONS @ (width, 1), np.int64)
    found = np.minimum(np.searchsorted(key, wanted, sorter=order), len(key) - 1)
    return np.where(key[order[found]] == wanted, order[found], -1)


def junction_pixels(boundaries: Boundaries) -> BoolArray:
    """Boundary pixels (P,) bool with more than two neighbours (section 4.2).

    There the next link of a chain is not determined. A corner of a 4-connected staircase is a junction
    in this sense as well as a place where three strands meet.
    """
    return np.count_nonzero(_neighbours(boundaries) >= 0, axis=1) > 2


def isolated_corners(boundaries: Boundaries) -> BoolArray:
    """Boundary pixels (P,) bool where a greedy chain code gets stuck (section 4.1, Figure 4).

    The walk starts at the first pixel of a slice in raster order, goes on to the neighbour of lowest
    Freeman code that was not visited, and never returns. Where it finds no successor it is stuck, unless
    it stands beside its own start with at least three pixels behind it, which closes the curve. Pixels
    left behind are walked next, until all have been visited.
    """
    return _greedy_dead_ends(_neighbours(boundaries))


@jit
def _greedy_dead_ends(neighbours: IntArray) -> BoolArray:  # a walk is sequential by nature
    count = len(neighbours)
    visited = np.zeros(count, np.bool_)
    stuck = np.zeros(count, np.bool_)
    for start in range(count):
        if visited[start]:
            continue
        current, length = start, 1
        visited[start] = True
        moving = True
        while moving:
            moving = False
            for code in range(8):
                candidate = neighbours[current, code]
                if candidate >= 0 and not visited[candidate]:
                    visited[candidate] = True
                    current, length, moving = candidate, length + 1, True
                    break
        closed = False
        if length >= 3:
            for code in range(8):
                closed |= neighbours[current, code] == start
        stuck[current] = not closed
    return stuck
