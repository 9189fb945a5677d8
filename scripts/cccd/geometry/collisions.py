"""Which triangles of a mesh pass through each other: of those that may, those that libigl finds to meet.

Triangles that meet have a cell of a grid in common. Where all triangles of a cell hang together and their
normals lie in a cone, their projection along its axis does not overlap itself, so that none passes through
another (Volino and Magnenat-Thalmann 1994). What this does not hold for is a small share of a smooth surface.
"""

from __future__ import annotations

import numpy as np

from cccd.geometry.arrays import (
    BoolArray,
    FloatArray,
    IntArray,
    connected_parts,
    distinct,
    ranks_of,
    unit_vectors,
)
from cccd.geometry.libigl import predicates
from cccd.geometry.sides import opposite_sides, pinched_vertices

#: Volumes below this share of the cube of a triangle's size count as none: the triangles only touch.
_TOUCHING = 1e-12
#: Where more of the triangles have moved all are searched: libigl takes no longer for that.
_MANY = 0.1
#: Cells of the grid, by the median edge: they hold some twenty triangles.
CELL_EDGES = 3.0
#: Normals of a cell differ from their mean by less: then they agree with each other, and nothing is folded.
CONE = np.cos(np.radians(44.5))
#: A mesh whose triangles reach into more cells on the mean has them of too many sizes for a grid.
MOST_CELLS = 8
#: Cells and their triangles are numbered by 64 bits.
MOST_KEYS = 2.0**60


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
        pairs = chosen[predicates.find_self_intersections(vertices, faces[chosen])[1].reshape(-1, 2)]
    else:
        chosen = np.flatnonzero(of)
        pairs = predicates.find_intersections(vertices, faces[chosen], vertices, faces)[1].reshape(-1, 2)
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


def may_cross(vertices: FloatArray, faces: IntArray) -> BoolArray:
    """Choose triangles (F,): those that are left out pass through none.

    Parameters
    ----------
    vertices, faces : (V, 3) float64, (F, 3) int64
        Any triangles; those of smooth, closed, oriented surfaces are chosen least.

    Examples
    --------
    >>> import trimesh
    >>> ball = trimesh.creation.icosphere(4)
    >>> int(may_cross(np.array(ball.vertices), np.array(ball.faces, np.int64)).sum())
    0
    """
    corners = vertices[faces]
    sides = np.linalg.norm(corners[:, 0] - corners[:, 1], axis=1)
    edge = CELL_EDGES * float(np.median(sides)) if len(sides) else 0.0
    everything = np.ones(len(faces), np.bool_)
    if not edge > 0 or np.prod(np.ptp(vertices, axis=0) / edge + 2) > MOST_KEYS:
        return everything
    low, high = (np.floor(end / edge).astype(np.int64) for end in (corners.min(axis=1), corners.max(axis=1)))
    sizes = high - low + 1
    reached = sizes.prod(axis=1)
    if reached.sum() > MOST_CELLS * len(faces):
        return everything
    owner, number = np.repeat(np.arange(len(faces)), reached), ranks_of(reached)
    _, wide, deep = sizes[owner].T
    at = low[owner] + np.column_stack([number // (wide * deep), number // deep % wide, number % deep])
    at -= low.min(axis=0)
    span = at.max(axis=0) + 1
    cell = distinct((at[:, 0] * span[1] + at[:, 1]) * span[2] + at[:, 2])[1]
    opposite = opposite_sides(faces)
    part = _hanging_together(opposite, owner, cell, reached)
    count = int(cell.max()) + 1
    cell_of_part = np.zeros(int(part.max()) + 1, np.int64)
    cell_of_part[part] = cell
    calm: BoolArray = np.bincount(cell_of_part, minlength=count) == 1
    normals = unit_vectors(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    sums = [np.bincount(cell, along) for along in normals[owner].T]
    mean = unit_vectors(np.column_stack(sums).astype(float))
    torn = (opposite < 0).reshape(-1, 3) | pinched_vertices(faces, opposite)[faces]
    turned = np.einsum("nc,nc->n", normals[owner], mean[cell]) < CONE
    calm[cell[turned | np.any(torn, axis=1)[owner]]] = False
    chosen = np.zeros(len(faces), np.bool_)
    chosen[owner[~calm[cell]]] = True
    return chosen


def _hanging_together(opposite: IntArray, owner: IntArray, cell: IntArray, reached: IntArray) -> IntArray:
    """Give the parts of triangles that share edges within a cell a number (N,) each.

    Parameters
    ----------
    opposite : (3 F,) int64
        Of `opposite_sides`.
    owner, cell : (N,) int64
        Triangles, ascending, and the cells that they reach into, ascending for each.
    reached : (F,) int64
        How many cells each triangle reaches into.
    """
    side = np.flatnonzero(opposite > np.arange(len(opposite)))
    one, other = side // 3, opposite[side] // 3
    keys = owner * (int(cell.max()) + 1) + cell
    here = np.repeat((np.cumsum(reached) - reached)[one], reached[one]) + ranks_of(reached[one])
    wanted = np.repeat(other, reached[one]) * (int(cell.max()) + 1) + cell[here]
    there = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
    both = keys[there] == wanted
    return connected_parts(here[both], there[both], len(keys))
