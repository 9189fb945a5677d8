"""Which triangles of a mesh pass through each other: of those that may, those that libigl finds to meet."""

from __future__ import annotations

import numpy as np

from cccd.geometry._igl import igl
from cccd.geometry.arrays import BoolArray, FloatArray, IntArray
from cccd.geometry.patches import may_cross

__all__ = ["MovingTriangles", "passing_pairs"]

#: Volumes below this share of the cube of a triangle's size count as none: the triangles only touch.
_TOUCHING = 1e-12
#: Where more of the triangles have moved all are searched: libigl takes no longer for that.
_MANY = 0.1


class MovingTriangles:
    """Triangles whose vertices move a few at a time: pairs of which neither has moved are not tested again.

    Parameters
    ----------
    faces : (F, 3) int64

    Examples
    --------
    >>> triangles = MovingTriangles(np.arange(6).reshape(2, 3))
    >>> points = np.array([(0.0, 0, 0), (2, 0, 0), (0, 2, 0), (0.5, 0.5, -1), (0.5, 0.5, 1), (9, 9, 0)])
    >>> triangles.passing_pairs(points).tolist()
    [[0, 1]]
    >>> points[3:] += (9, 0, 0)
    >>> triangles.passing_pairs(points).tolist()
    []
    """

    def __init__(self, faces: IntArray) -> None:
        self.faces = faces
        self._vertices: FloatArray = np.full(3, np.nan)  # which all differ from
        self._pairs = np.zeros((0, 2), np.int64)

    def passing_pairs(self, vertices: FloatArray) -> IntArray:
        """Find the pairs (K, 2) that pass through each other, with the vertices (V, 3) as they are now."""
        moved = np.any(np.any(vertices != self._vertices, axis=1)[self.faces], axis=1)
        if np.count_nonzero(moved) > _MANY * len(moved):
            self._pairs = passing_pairs(vertices, self.faces)
        else:
            still = self._pairs[~moved[self._pairs].any(axis=1)]
            self._pairs = np.concatenate([still, passing_pairs(vertices, self.faces, moved)])
        self._vertices = vertices.copy()
        return self._pairs


def passing_pairs(vertices: FloatArray, faces: IntArray, of: BoolArray | None = None) -> IntArray:
    """Find the pairs (K, 2) of triangles that pass through each other.

    Pairs that share an edge are not looked at; of pairs that share a vertex, the opposite edges are.
    Touching without passing through does not count.

    Parameters
    ----------
    vertices, faces : (V, 3) float64, (F, 3) int64
    of : (F,) bool, optional
        Triangles of which each pair has one at least; by default all.
    """
    vertices, faces = np.ascontiguousarray(vertices, float), np.ascontiguousarray(faces, np.int64)
    if of is None:
        chosen = np.flatnonzero(may_cross(vertices, faces))
        pairs = chosen[igl.predicates.find_self_intersections(vertices, faces[chosen])[1].reshape(-1, 2)]
    else:
        chosen = np.flatnonzero(of)
        pairs = igl.predicates.find_intersections(vertices, faces[chosen], vertices, faces)[1].reshape(-1, 2)
        pairs[:, 0] = chosen[pairs[:, 0]]
    pairs = np.sort(pairs, axis=1)
    pairs = np.column_stack(np.divmod(np.unique(pairs @ [len(faces), 1]), max(len(faces), 1)))
    return pairs[_pass(vertices, faces[pairs[:, 0]], faces[pairs[:, 1]])]


def _pass(vertices: FloatArray, first: IntArray, second: IntArray) -> BoolArray:
    """Whether an edge of one of two triangles (K, 3), (K, 3) pierces the other."""
    same = first[:, :, None] == second[:, None, :]
    shared = same.sum(axis=(1, 2))
    corners = vertices[first], vertices[second]
    tiny = _TOUCHING * np.maximum(*(np.ptp(points, axis=1).max(axis=1) for points in corners)) ** 3
    found = np.zeros(len(first), np.bool_)
    for own, other, met in ((*corners, same.any(axis=2)), (*corners[::-1], same.any(axis=1))):
        for n in range(3):  # beside a shared corner only the opposite edge can pierce
            edge = (shared == 0) | ((shared == 1) & met[:, n - 1])
            edge[edge] = _pierces(own[edge, n], own[edge, n - 2], other[edge], tiny[edge])
            found |= edge
    return found


def _pierces(a: FloatArray, b: FloatArray, corners: FloatArray, tiny: FloatArray) -> BoolArray:
    """Whether edges from points (K, 3) to others pass through the inside of triangles (K, 3, 3)."""
    p, q, r = corners.swapaxes(0, 1)
    ends = np.array([_six_volumes(p, q, r, a), _six_volumes(p, q, r, b)])
    sides = np.array([_six_volumes(a, b, *side) for side in ((p, q), (q, r), (r, p))])
    inside = np.all(sides > tiny, axis=0) | np.all(sides < -tiny, axis=0)
    return inside & np.all(np.abs(ends) > tiny, axis=0) & ((ends[0] > 0) != (ends[1] > 0))


def _six_volumes(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray) -> FloatArray:
    """Six times the signed volumes (K,) of tetrahedra."""
    return np.einsum("kc,kc->k", a - d, np.cross(b - d, c - d))
