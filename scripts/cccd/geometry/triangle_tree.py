"""Triangles in a tree of boxes: which of them is nearest to a point, and which one a line meets first."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from cccd.geometry._jit import jit, jit_within
from cccd.geometry.arrays import FloatArray, IntArray
from cccd.geometry.mesh import Mesh
from cccd.geometry.triangles import Point, corners_of, met_at, point_of, squared_distance

__all__ = ["TriangleTree"]

#: A box at the bottom has so many triangles, up to twice as many.
_IN_BOX = 4
#: No more boxes wait at a time: one on each level of the tree, and another.
_WAITING = 64


class _Boxes(NamedTuple):
    """Bounds (B, 6) of boxes, where each lowest one begins in an order (F,) of the triangles, the mesh."""

    bounds: FloatArray
    first: IntArray
    order: IntArray
    vertices: FloatArray
    faces: IntArray


class TriangleTree:
    """A tree of boxes over the triangles of a mesh.

    Parameters
    ----------
    mesh : Mesh
        With a triangle at least.
    """

    def __init__(self, mesh: Mesh) -> None:
        corners = mesh.vertices[mesh.faces]
        low, high = corners.min(axis=1), corners.max(axis=1)
        count = len(mesh.faces)
        leaves = 1 << max(0, (count // _IN_BOX).bit_length() - 1)
        first = np.arange(leaves + 1) * count // leaves
        tree = cKDTree((low + high) / 2, balanced_tree=False, compact_nodes=False)
        order = np.asarray(tree.indices, np.int64)  # neighbours in space are neighbours in it
        levels = [
            np.hstack(
                [
                    np.minimum.reduceat(low[order], first[:-1]),
                    np.maximum.reduceat(high[order], first[:-1]),
                ]
            )
        ]
        while len(levels[-1]) > 1:
            left, right = levels[-1][::2], levels[-1][1::2]
            below = np.minimum(left[:, :3], right[:, :3]), np.maximum(left[:, 3:], right[:, 3:])
            levels.append(np.hstack(below))
        bounds = np.concatenate([np.zeros((1, 6)), *levels[::-1]])  # box n holds boxes 2 n and 2 n + 1
        vertices = np.ascontiguousarray(mesh.vertices, float)
        self._boxes = _Boxes(bounds, first, order, vertices, np.ascontiguousarray(mesh.faces, np.int64))

    def nearest(self, points: FloatArray) -> IntArray:
        """Faces (P,) that are nearest to points (P, 3)."""
        found, waiting = np.zeros(len(points), np.int64), np.empty(_WAITING, np.int64)
        _find_nearest(np.ascontiguousarray(points, float), self._boxes, waiting, np.empty(_WAITING), found)
        return found

    def first_hits(self, starts: FloatArray, ends: FloatArray) -> FloatArray:
        """Share (P,) of the ways from points (P, 3) to others (P, 3) at which they meet the mesh; else 1."""
        starts, ways = np.ascontiguousarray(starts, float), np.ascontiguousarray(ends - starts, float)
        share, waiting = np.ones(len(starts)), np.empty(_WAITING, np.int64)
        _find_first(starts, ways, self._boxes, waiting, share)
        return share


@jit
def _find_nearest(
    points: FloatArray,
    boxes: _Boxes,
    waiting: IntArray,
    gaps: FloatArray,
    found: IntArray,
) -> None:
    first, order, leaves = boxes.first, boxes.order, len(boxes.first) - 1
    for n in range(len(points)):
        point, least = point_of(points, n), np.inf
        waiting[0], gaps[0], count = 1, 0.0, 1
        while count > 0:
            count -= 1
            box = waiting[count]
            if gaps[count] >= least:
                continue
            if box < leaves:
                for half in range(2 * box, 2 * box + 2):
                    waiting[count], gaps[count] = half, _gap(boxes.bounds, half, point)
                    count += 1
                if gaps[count - 1] > gaps[count - 2]:  # the nearer half is looked at first
                    waiting[count - 1], waiting[count - 2] = waiting[count - 2], waiting[count - 1]
                    gaps[count - 1], gaps[count - 2] = gaps[count - 2], gaps[count - 1]
                continue
            for m in range(first[box - leaves], first[box - leaves + 1]):
                squared = squared_distance(point, *corners_of(boxes.vertices, boxes.faces, order[m]))
                if squared < least:
                    least, found[n] = squared, order[m]


@jit_within
def _gap(boxes: FloatArray, box: int, point: Point) -> float:
    """Squared distance from a point to a box."""
    squared = 0.0
    for axis in range(3):
        away = max(boxes[box, axis] - point[axis], point[axis] - boxes[box, axis + 3], 0.0)
        squared += away * away
    return squared


@jit
def _find_first(
    starts: FloatArray,
    ways: FloatArray,
    boxes: _Boxes,
    waiting: IntArray,
    share: FloatArray,
) -> None:
    first, order, leaves = boxes.first, boxes.order, len(boxes.first) - 1
    for n in range(len(starts)):
        start, way = point_of(starts, n), point_of(ways, n)
        waiting[0], count = 1, 1
        while count > 0:
            count -= 1
            box = waiting[count]
            if _entered(boxes.bounds, box, start, way) > share[n]:
                continue
            if box < leaves:
                waiting[count], waiting[count + 1] = 2 * box, 2 * box + 1
                count += 2
                continue
            for m in range(first[box - leaves], first[box - leaves + 1]):
                f = order[m]
                at = met_at(start, way, *corners_of(boxes.vertices, boxes.faces, f))
                share[n] = min(share[n], at)


@jit_within
def _entered(boxes: FloatArray, box: int, start: Point, way: Point) -> float:
    """Share of a way at which it enters a box; infinity where it does not."""
    enters, leaves = 0.0, 1.0
    for axis in range(3):
        low, high = boxes[box, axis] - start[axis], boxes[box, axis + 3] - start[axis]
        if way[axis] == 0:
            if low > 0 or high < 0:
                return np.inf
        else:
            near, far = low / way[axis], high / way[axis]
            enters, leaves = max(enters, min(near, far)), min(leaves, max(near, far))
    return enters if enters <= leaves else np.inf
