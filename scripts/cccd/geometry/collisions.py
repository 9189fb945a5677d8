"""Which triangles of a mesh pass through each other.

Triangles are sorted into the cells of a grid about twice as wide as they are; only those that share a cell
are tested, each pair in the lowest cell that both reach.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cccd.geometry._jit import jit
from cccd.geometry.arrays import FloatArray, IntArray

__all__ = ["passing_pairs"]

#: Volumes below this share of the cube of a triangle's size count as none: the triangles only touch.
_TOUCHING = 1e-12


class _Triangles(NamedTuple):
    """Triangles, their bounding boxes, and the cells that the boxes reach."""

    corners: FloatArray  # (F, 3, 3)
    faces: IntArray  # (F, 3), to tell which corners are shared
    low: FloatArray  # (F, 3)
    high: FloatArray  # (F, 3)
    first: IntArray  # (F, 3), cell of the lower corner of the box
    last: IntArray  # (F, 3), cell of the upper corner
    cells: IntArray  # (3,), number of cells along each axis


def passing_pairs(vertices: FloatArray, faces: IntArray) -> IntArray:
    """Find the pairs (K, 2) of triangles that pass through each other.

    Pairs that share an edge are not looked at; of pairs that share a vertex, the opposite edges are.
    Touching without passing through does not count.

    Parameters
    ----------
    vertices, faces : (V, 3) float64, (F, 3) int64
    """
    if len(faces) == 0:
        return np.zeros((0, 2), np.int64)
    triangles = _in_cells(np.asarray(vertices, float), np.asarray(faces, np.int64))
    entries = int(np.prod(triangles.last - triangles.first + 1, axis=1).sum())
    cell, member = _grid_entries(triangles, entries)
    order = np.argsort(cell, kind="stable")
    cell, member = cell[order], member[order]
    starts = np.concatenate([[0], np.flatnonzero(np.diff(cell)) + 1, [len(cell)]])
    return np.array(_pairs_in_cells(triangles, cell, member, starts), np.int64).reshape(-1, 2)


def _in_cells(vertices: FloatArray, faces: IntArray) -> _Triangles:
    corners = np.ascontiguousarray(vertices[faces])
    low: FloatArray = corners.min(axis=1)
    high: FloatArray = corners.max(axis=1)
    size = float(np.mean(high - low)) * 2 + 1e-12
    lowest: FloatArray = low.min(axis=0)
    first = np.floor((low - lowest) / size).astype(np.int64)
    last = np.floor((high - lowest) / size).astype(np.int64)
    return _Triangles(corners, faces, low, high, first, last, np.add(last.max(axis=0), 1))


@jit
def _grid_entries(triangles: _Triangles, entries: int) -> tuple[IntArray, IntArray]:
    """Every cell that a triangle's box reaches, and the triangle."""
    first, last, cells = triangles.first, triangles.last, triangles.cells
    cell = np.empty(entries, np.int64)
    member = np.empty(entries, np.int64)
    at = 0
    for f in range(len(first)):
        for x in range(first[f, 0], last[f, 0] + 1):
            for y in range(first[f, 1], last[f, 1] + 1):
                for z in range(first[f, 2], last[f, 2] + 1):
                    cell[at] = (x * cells[1] + y) * cells[2] + z
                    member[at] = f
                    at += 1
    return cell, member


@jit
def _pairs_in_cells(
    triangles: _Triangles, cell: IntArray, member: IntArray, starts: IntArray
) -> Sequence[tuple[np.int64, np.int64]]:
    """Pairs that pass through each other; ``member[starts[n]:starts[n + 1]]`` reach one cell."""
    found = [(np.int64(0), np.int64(0)) for _ in range(0)]  # typed and empty
    for n in range(len(starts) - 1):
        for m in range(starts[n], starts[n + 1]):
            for o in range(m + 1, starts[n + 1]):
                f, g = member[m], member[o]
                if _first_shared_cell(triangles, f, g) == cell[starts[n]] and _pass(triangles, f, g):
                    found.append((f, g))
    return found


@jit
def _first_shared_cell(triangles: _Triangles, f: int, g: int) -> int:
    """Find the lowest cell that the boxes of two triangles both reach; -1 where they are apart."""
    cell = 0
    for axis in range(3):
        if triangles.low[f, axis] > triangles.high[g, axis]:
            return -1
        if triangles.low[g, axis] > triangles.high[f, axis]:
            return -1
        cell = cell * triangles.cells[axis] + max(triangles.first[f, axis], triangles.first[g, axis])
    return cell


@jit
def _pass(triangles: _Triangles, f: int, g: int) -> bool:
    """Whether an edge of one of two triangles pierces the other."""
    corners, faces = triangles.corners, triangles.faces
    shared, own_f, own_g = 0, -1, -1
    for x in range(3):
        for y in range(3):
            if faces[f, x] == faces[g, y]:
                shared += 1
                own_f, own_g = x, y
    if shared >= 2:
        return False
    scale = 0.0
    for axis in range(3):
        scale = max(scale, triangles.high[f, axis] - triangles.low[f, axis])
        scale = max(scale, triangles.high[g, axis] - triangles.low[g, axis])
    tiny = _TOUCHING * scale**3
    for x in range(3):  # beside a shared corner only the opposite edge can pierce
        y = (x + 1) % 3
        if (shared == 0 or x == (own_f + 1) % 3) and _pierces(corners[f, x], corners[f, y], corners[g], tiny):
            return True
        if (shared == 0 or x == (own_g + 1) % 3) and _pierces(corners[g, x], corners[g, y], corners[f], tiny):
            return True
    return False


@jit
def _pierces(a: FloatArray, b: FloatArray, triangle: FloatArray, tiny: float) -> bool:
    """Whether the segment ab passes through the inside of a triangle (3, 3)."""
    p, q, r = triangle[0], triangle[1], triangle[2]
    start, end = _six_volumes(p, q, r, a), _six_volumes(p, q, r, b)
    if start * end >= 0 or abs(start) < tiny or abs(end) < tiny:
        return False
    s, t, w = _six_volumes(a, b, p, q), _six_volumes(a, b, q, r), _six_volumes(a, b, r, p)
    if abs(s) < tiny or abs(t) < tiny or abs(w) < tiny:
        return False
    return (s > 0) == (t > 0) == (w > 0)


@jit
def _six_volumes(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray) -> float:
    """Six times the signed volume of a tetrahedron."""
    ax, ay, az = a[0] - d[0], a[1] - d[1], a[2] - d[2]
    bx, by, bz = b[0] - d[0], b[1] - d[1], b[2] - d[2]
    cx, cy, cz = c[0] - d[0], c[1] - d[1], c[2] - d[2]
    return ax * (by * cz - bz * cy) - ay * (bx * cz - bz * cx) + az * (bx * cy - by * cx)
