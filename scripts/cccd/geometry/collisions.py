"""Which triangles of a mesh pass through each other: of those that may, those that libigl finds to meet.

Triangles of one direction that hang together in a cell of a grid are a patch. Where all normals of a patch
and of one beside it lie in a cone, its projection along the axis does not overlap itself, so that nothing
passes through anything (Volino and Magnenat-Thalmann 1994). Patches that do not touch lie apart where a
plane parts them. What neither holds for is a small share of a smooth surface.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array

from cccd.geometry.arrays import (
    BoolArray,
    FloatArray,
    IntArray,
    connected_parts,
    offsets_of,
    ranks_of,
    unit_vectors,
)
from cccd.geometry.libigl import predicates
from cccd.geometry.sides import opposite_sides, pinched_vertices

#: Volumes below this share of the cube of a triangle's size count as none: the triangles only touch.
_TOUCHING = 1e-12
#: Where more of the triangles have moved all are searched: libigl takes no longer for that.
_MANY = 0.1
#: Cells of the grid, by the median edge: patches have some twenty triangles.
CELL_EDGES = 3.0
#: Normals of two patches differ by less: then all around them agree with any mean of theirs, and nothing is
#: folded between.
TURN = np.radians(89.0)
#: A mesh whose patches cover more cells on the mean has triangles of too many sizes for a grid.
MOST_CELLS = 60
#: Fewer triangles of a patch on the mean take longer than all at once.
FEWEST = 6
#: Cells, and six directions in each, are numbered by 64 bits.
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


# Which may --------------------------------------------------------------------------------------------


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
    edges = np.linalg.norm(vertices[faces[:, 0]] - vertices[faces[:, 1]], axis=1)
    cell = CELL_EDGES * float(np.median(edges)) if len(edges) else 0.0
    everything = np.ones(len(faces), np.bool_)
    if not cell > 0 or np.prod(np.ptp(vertices, axis=0) / cell + 2) > MOST_KEYS:
        return everything
    patches = _Patches(vertices, faces, cell)
    if patches.count * FEWEST > len(faces):
        return everything
    apart = patches.far_pairs()
    if apart is None:
        return everything
    chosen = patches.irregular
    for pairs in (patches.folded(patches.touching), patches.not_parted(apart)):
        chosen[pairs] = True
    return chosen[patches.of]


class _Patches:
    """Triangles of about one direction that share edges within the cells of a grid.

    Parameters
    ----------
    vertices, faces : (V, 3) float64, (F, 3) int64
    cell : float
        Edge of the grid's cells.

    Attributes
    ----------
    of : (F,) int64
        The patch of each triangle, from 0.
    """

    def __init__(self, vertices: FloatArray, faces: IntArray, cell: float) -> None:
        self.vertices, self.faces, self.cell = vertices, faces, cell
        a, b, c = (vertices[corner] for corner in faces.T)
        self.normals = unit_vectors(np.cross(b - a, c - a))
        largest = np.abs(self.normals).argmax(axis=1)
        direction = 2 * largest + (self.normals[np.arange(len(faces)), largest] > 0)
        key = 6 * _cell_numbers(np.floor((a + b + c) / (3 * cell)).astype(np.int64)) + direction
        self.opposite = opposite_sides(faces)
        side = np.flatnonzero(self.opposite >= 0)
        one, other = side // 3, self.opposite[side] // 3
        alike = key[one] == key[other]
        self.of = connected_parts(one[alike], other[alike], len(faces))
        self.count = int(self.of.max()) + 1
        self._corners = _incidence(np.repeat(self.of, 3), faces.ravel(), (self.count, len(vertices)))
        self._points = vertices[self._corners.indices]
        sums = [np.bincount(self.of, along) for along in self.normals.T]
        self.axes = unit_vectors(np.column_stack(sums).astype(float))
        self._cone = np.zeros(self.count)
        np.maximum.at(self._cone, self.of, _angles(self.normals, self.axes[self.of]))

    @property
    def irregular(self) -> BoolArray:
        """_Patches (P,) that bend, have an edge that is not of two triangles, or a vertex of several fans."""
        pinched = pinched_vertices(self.faces, self.opposite)[self.faces]
        wrong = 2 * self._cone > TURN
        wrong[self.of[((self.opposite < 0).reshape(-1, 3) | pinched).any(axis=1)]] = True
        return wrong

    @cached_property
    def touching(self) -> IntArray:
        """Pairs (K, 2) of patches that share a vertex."""
        return _pairs(self._corners)

    def folded(self, pairs: IntArray) -> IntArray:
        """Those of pairs (K, 2) of patches whose normals lie in no common cone."""
        one, other = pairs.T
        most = _angles(self.axes[one], self.axes[other]) + self._cone[one] + self._cone[other]
        return pairs[most > TURN]

    def far_pairs(self) -> IntArray | None:
        """Pairs (K, 2) of patches in one cell that share no vertex; None where a grid does not serve."""
        low, high = self._extent(np.reshape(self._points, (-1, 3)), np.arange(self.count))
        first, last = (np.floor(side / self.cell).astype(np.int64) for side in (low, high))
        sizes = last - first + 1
        count = sizes.prod(axis=1)
        if count.sum() > MOST_CELLS * self.count:
            return None
        patch = np.repeat(np.arange(self.count), count)
        number = ranks_of(count)
        _, wide, deep = sizes[patch].T
        offset = np.column_stack([number // (wide * deep), number // deep % wide, number % deep])
        cells, place = np.unique(_cell_numbers(first[patch] + offset), return_inverse=True)
        near = _pairs(_incidence(patch, place, (self.count, len(cells))))
        far = np.setdiff1d(near @ [self.count, 1], self.touching @ [self.count, 1], assume_unique=True)
        pairs = np.column_stack(np.divmod(far, self.count))
        one, other = pairs.T
        return pairs[np.all((low[one] <= high[other]) & (low[other] <= high[one]), axis=1)]

    def not_parted(self, pairs: IntArray) -> IntArray:
        """Those of pairs (K, 2) of patches that no plane of four directions parts."""
        middle = np.add.reduceat(self._points, self._corners.indptr[:-1])
        middle /= np.diff(self._corners.indptr)[:, None]
        normal = self.axes
        directions: list[Callable[[IntArray, IntArray], FloatArray]] = [
            lambda one, other: middle[other] - middle[one],
            lambda one, other: normal[one],
            lambda one, other: normal[other],
            lambda one, other: np.cross(normal[one], np.cross(middle[other] - middle[one], normal[one])),
        ]
        for direction in directions:
            along = direction(*pairs.T)
            (low, high), (least, most) = (self._along(side, along) for side in pairs.T)
            pairs = pairs[(low <= most) & (least <= high)]
        return pairs

    def _along(self, patches: IntArray, directions: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Where patches (K,) begin and end (K,), (K,) along a direction (K, 3) each."""
        start, count = self._corners.indptr[patches], np.diff(self._corners.indptr)[patches]
        at = ranks_of(count) + np.repeat(start, count)
        return self._extent(_dots(self._points[at], np.repeat(directions, count, axis=0)), patches)

    def _extent(self, values: FloatArray, patches: IntArray) -> tuple[FloatArray, FloatArray]:
        """Least and largest of values at the vertices of patches (K,), one after the other."""
        if len(patches) == 0:
            return values, values
        start = offsets_of(np.diff(self._corners.indptr)[patches])[:-1]
        return np.minimum.reduceat(values, start), np.maximum.reduceat(values, start)


def _cell_numbers(cells: IntArray) -> IntArray:
    """Numbers (K,) of cells (K, 3) of a grid."""
    cells = cells - cells.min(axis=0)
    _, wide, deep = cells.max(axis=0) + 1
    return (cells[:, 0] * wide + cells[:, 1]) * deep + cells[:, 2]


def _incidence(rows: IntArray, columns: IntArray, shape: tuple[int, int]) -> csr_array:
    """Sparse matrix with a one wherever a row meets a column."""
    matrix = csr_array((np.ones(len(rows), np.int32), (rows, columns)), shape=shape)
    matrix.data[:] = 1
    return matrix


def _pairs(rows: csr_array) -> IntArray:
    """Pairs (K, 2), ascending, of rows with a column in common."""
    shared = (rows @ rows.T).tocoo()
    once = shared.row < shared.col
    return np.column_stack([shared.row[once], shared.col[once]]).astype(np.int64)


def _dots(one: FloatArray, other: FloatArray) -> FloatArray:
    return np.einsum("kc,kc->k", one, other)


def _angles(one: FloatArray, other: FloatArray) -> FloatArray:
    """Angles (K,) between unit vectors (K, 3)."""
    return np.arccos(np.clip(_dots(one, other), -1, 1))
