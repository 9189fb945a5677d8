"""A quad layout on a mesh: every triangle of a decimated mesh becomes three quads, sampled on the mesh.

Quads share corners and edges, and the samples on a common edge are the same points: what is fitted to them is
closed by construction.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from scipy.sparse import coo_array, csr_array
from scipy.spatial import cKDTree

from cccd.geometry._jit import jit
from cccd.geometry.arrays import BoolArray, FloatArray, IntArray
from cccd.geometry.mesh import Mesh
from cccd.tolerances import TINY

__all__ = ["Footpoints", "Layout", "grid_ids", "grid_triangles", "lay_flat", "lay_quads", "with_flat"]

#: Triangles tried for the nearest point that faces the same way.
_TRIED = 24

#: Cosine from which two normals agree.
_AGREEING = 0.2

#: Steps in which samples beside flat triangles follow those on them.
_FOLLOWING = 30

#: Steps of tangential smoothing after each subdivision, and their length.
_ROUNDS, _STEP = 3, 0.5


@dataclass(frozen=True)
class Layout:
    """Quads and the samples on them.

    Attributes
    ----------
    quads : (Q, 4) int64
        Corners, counter-clockwise from outside; each third of the list has one quad of every triangle.
    ids : (Q, n, n) int64
        Numbers of the samples: along the first axis from corner 0 to 3, along the second from 0 to 1.
    points : (P, 3) float64
        The samples, in mm.
    """

    quads: IntArray
    ids: IntArray
    points: FloatArray


def grid_ids(quads: IntArray, count: int) -> IntArray:
    """Return a number for each point of a grid on every quad; neighbours share those of their common edge.

    Parameters
    ----------
    quads : (Q, 4) int64
        Corners; no two edges may have the same two ends.
    count : int
        Points along an edge, its ends included.

    Returns
    -------
    (Q, count, count) int64
        Corners keep their numbers, which are the lowest; then come the edges', then the inner points'.

    Examples
    --------
    >>> two = np.array([(0, 1, 2, 3), (1, 4, 5, 2)])
    >>> first, second = grid_ids(two, 4)
    >>> bool(np.array_equal(first[:, -1], second[:, 0])), int(max(first.max(), second.max()))
    (True, 27)
    """
    inner = count - 2
    ends = np.stack([quads, np.roll(quads, -1, axis=1)], axis=2).reshape(-1, 2)
    edges, edge = np.unique(np.sort(ends, axis=1), axis=0, return_inverse=True)
    first = int(quads.max()) + 1
    along = first + edge.reshape(-1, 1) * inner + np.arange(inner)
    backwards = ends[:, 0] > ends[:, 1]
    along[backwards] = along[backwards, ::-1]
    along = along.reshape(len(quads), 4, inner)
    ids = np.empty((len(quads), count, count), np.int64)
    ids[:, 0, 0], ids[:, 0, -1], ids[:, -1, -1], ids[:, -1, 0] = quads.T
    ids[:, 0, 1:-1], ids[:, 1:-1, -1] = along[:, 0], along[:, 1]
    ids[:, -1, 1:-1], ids[:, 1:-1, 0] = along[:, 2, ::-1], along[:, 3, ::-1]
    rest = first + len(edges) * inner
    ids[:, 1:-1, 1:-1] = rest + np.arange(len(quads) * inner**2).reshape(len(quads), inner, inner)
    return ids


def grid_triangles(quads: IntArray, samples: FloatArray) -> Mesh:
    """Triangles through samples (Q, n, n, 3) of quads (Q, 4), closed where those are."""
    ids = grid_ids(quads, samples.shape[1])
    points = np.empty((int(ids.max()) + 1, 3))
    points[ids] = samples
    low, high = slice(-1), slice(1, None)
    a, b, c, d = (
        ids[:, rows, columns].ravel()
        for rows, columns in ((low, low), (low, high), (high, high), (high, low))
    )
    return Mesh(points, np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])]))


def lay_quads(coarse: Mesh, target: Footpoints, subdivisions: int) -> Layout:
    """Lay three quads on each triangle of a coarse mesh and sample them on the fine one.

    Parameters
    ----------
    coarse : Mesh
        A closed manifold, near to the fine mesh and of the same topology.
    target : Footpoints
        Of the fine mesh.
    subdivisions : int
        Each doubles the samples along an edge; a quad starts with its corners alone.
    """
    quads, points = _three_quads(coarse)
    layout = _relaxed(Layout(quads, grid_ids(quads, 2), points), target)
    for _ in range(subdivisions):
        layout = _relaxed(_subdivided(layout), target)
    return layout


def lay_flat(coarse: Mesh, subdivisions: int) -> Layout:
    """Lay three quads on each triangle of a mesh and sample them on that mesh, numbered as by `lay_quads`."""
    quads, points = _three_quads(coarse)
    layout = Layout(quads, grid_ids(quads, 2), points)
    for _ in range(subdivisions):
        layout = _subdivided(layout)
    return layout


def with_flat(layout: Layout, planar: Layout, flat: BoolArray) -> Layout:
    """Take the samples of some triangles from another layout; those of triangles beside them follow.

    Parameters
    ----------
    layout, planar : Layout
        As `lay_quads` and `lay_flat` lay them on one mesh.
    flat : (F,) bool
        The triangles.
    """
    held = np.zeros(len(layout.points), np.bool_)
    held[layout.ids[np.tile(flat, 3)]] = True
    beside = held[layout.ids].any(axis=(1, 2)).reshape(3, -1).any(axis=0)
    free = np.zeros(len(held), np.bool_)
    free[layout.ids[np.tile(beside, 3)]] = True
    free[layout.ids[np.tile(~beside, 3)]] = False
    free &= ~held
    move = np.where(held[:, None], planar.points - layout.points, 0.0)
    mean = _links(layout.ids, len(held))[np.flatnonzero(free)]
    for _ in range(_FOLLOWING):
        move[free] = mean @ move
    return Layout(layout.quads, layout.ids, layout.points + move)


def _three_quads(mesh: Mesh) -> tuple[IntArray, FloatArray]:
    """Split each triangle at its centre and the middles of its edges."""
    faces, count = mesh.faces, len(mesh.vertices)
    ends = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2)
    edges, middle = np.unique(np.sort(ends, axis=1), axis=0, return_inverse=True)
    middle = count + middle.reshape(-1, 3)
    centre = count + len(edges) + np.arange(len(faces))
    quads = [np.column_stack([faces[:, k], middle[:, k], centre, middle[:, k - 1]]) for k in range(3)]
    points = [mesh.vertices, mesh.vertices[edges].mean(axis=1), mesh.vertices[faces].mean(axis=1)]
    return np.concatenate(quads), np.concatenate(points)


def _subdivided(layout: Layout) -> Layout:
    """Halve the distance of the samples."""
    known = layout.points[layout.ids]
    count = known.shape[1]
    grid = np.empty((len(known), 2 * count - 1, 2 * count - 1, 3))
    grid[:, ::2, ::2] = known
    grid[:, 1::2, ::2] = (known[:, 1:] + known[:, :-1]) / 2
    grid[:, :, 1::2] = (grid[:, :, 2::2] + grid[:, :, :-2:2]) / 2
    ids = grid_ids(layout.quads, 2 * count - 1)
    points = np.empty((int(ids.max()) + 1, 3))
    points[ids] = grid
    return Layout(layout.quads, ids, points)


def _links(ids: IntArray, count: int) -> csr_array:
    """Weights (P, P) by which each sample is the mean of those beside it."""
    pairs = [np.stack([ids[:, 1:], ids[:, :-1]], axis=-1), np.stack([ids[:, :, 1:], ids[:, :, :-1]], axis=-1)]
    ends = np.unique(np.sort(np.concatenate([p.reshape(-1, 2) for p in pairs]), axis=1), axis=0)
    both = np.concatenate([ends, ends[:, ::-1]])
    shares = 1 / np.bincount(both[:, 0], minlength=count)
    return coo_array((shares[both[:, 0]], (both[:, 0], both[:, 1])), shape=(count, count)).tocsr()


def _relaxed(layout: Layout, target: Footpoints) -> Layout:
    """Smooth the samples along the mesh and bring them onto it, each to where the mesh faces as they do."""
    mean = _links(layout.ids, len(layout.points))
    points, normals = target.nearest(layout.points, _sample_normals(layout.ids, layout.points))
    for _ in range(_ROUNDS):
        move = mean @ points - points
        move -= normals * np.einsum("pc,pc->p", move, normals)[:, None]
        facing = _sample_normals(layout.ids, points)
        points, normals = target.nearest(points + _STEP * move, facing)
    return Layout(layout.quads, layout.ids, points)


def _sample_normals(ids: IntArray, points: FloatArray) -> FloatArray:
    """Return unit normals (P, 3) at the samples, from the cells around each."""
    corners = (ids[:, :-1, :-1], ids[:, :-1, 1:], ids[:, 1:, 1:], ids[:, 1:, :-1])
    a, b, c, d = (points[corner] for corner in corners)
    cells = np.cross(c - a, d - b).reshape(-1, 3)
    return _unit(_summed(corners, cells, len(points)))


def _summed(owners: tuple[IntArray, ...], values: FloatArray, count: int) -> FloatArray:
    """Sum values (N, 3) over the owners (N,) in each of several lists."""
    total = np.zeros((count, 3))
    for owner in owners:
        for axis in range(3):
            total[:, axis] += np.bincount(owner.ravel(), values[:, axis], count)
    return total


def _unit(vectors: FloatArray) -> FloatArray:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), TINY)


# Nearest points ---------------------------------------------------------------------------------------


class Footpoints:
    """Nearest points on a mesh, of the parts that face as one does.

    Parameters
    ----------
    mesh : Mesh
        Oriented. Large triangles are split first, so that the nearest one has its centre near.
    """

    def __init__(self, mesh: Mesh) -> None:
        import trimesh

        edge = 2 * float(np.sqrt(4 / np.sqrt(3) * mesh.area / len(mesh.faces)))
        corners = mesh.vertices[mesh.faces]
        normals = mesh.vertex_normals[mesh.faces]
        longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
        large = longest > edge
        if large.any():
            vertices, faces, index = cast(Any, trimesh).remesh.subdivide_to_size(
                mesh.vertices, mesh.faces[large], edge, max_iter=20, return_index=True
            )
            owner = np.flatnonzero(large)[index]
            small = np.asarray(vertices)[np.asarray(faces)]
            flat = np.repeat(mesh.unit_normals[owner][:, None], 3, axis=1)
            corners = np.concatenate([corners[~large], small])
            normals = np.concatenate([normals[~large], flat])
        self._corners, self._normals = np.ascontiguousarray(corners), np.ascontiguousarray(normals)
        self._tree = cKDTree(corners.mean(axis=1), balanced_tree=False, compact_nodes=False)

    def nearest(self, points: FloatArray, facing: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Nearest points (P, 3) to some, and the normals (P, 3) there.

        Parameters
        ----------
        points : (P, 3) float64
        facing : (P, 3) float64
            Unit vectors that the normals should agree with; where none nearby does any will do.
        """
        count = min(_TRIED, len(self._corners))
        tried = np.asarray(self._tree.query(points, k=range(1, count + 1))[1], np.int64)
        return _nearest_facing(
            np.ascontiguousarray(points), np.ascontiguousarray(facing), tried, self._corners, self._normals
        )


@jit
def _nearest_facing(
    points: FloatArray, facing: FloatArray, tried: IntArray, corners: FloatArray, normals: FloatArray
) -> tuple[FloatArray, FloatArray]:
    found, there = np.empty(points.shape), np.empty(points.shape)
    weights = np.empty(3)
    for n in range(len(points)):
        agreed, least = False, np.inf
        for f in tried[n]:
            agreement = 0.0
            for axis in range(3):
                mean = normals[f, 0, axis] + normals[f, 1, axis] + normals[f, 2, axis]
                agreement += mean * facing[n, axis] / 3
            if agreed and agreement < _AGREEING:
                continue
            squared = _barycentric(points[n], corners[f], weights)
            if squared < least or (not agreed and agreement >= _AGREEING):
                least = squared
                size = 0.0
                for axis in range(3):
                    x, m = 0.0, 0.0
                    for k in range(3):
                        x += weights[k] * corners[f, k, axis]
                        m += weights[k] * normals[f, k, axis]
                    found[n, axis], there[n, axis] = x, m
                    size += m * m
                size = np.sqrt(size) + TINY
                for axis in range(3):
                    there[n, axis] /= size
            agreed = agreed or agreement >= _AGREEING
    return found, there


@jit
def _barycentric(p: FloatArray, corners: FloatArray, weights: FloatArray) -> float:
    """Write the weights of a triangle's nearest point; return its squared distance (Ericson 2005, 5.1.5)."""
    d1, d2, d3, d4, d5, d6 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for axis in range(3):
        ab = corners[1, axis] - corners[0, axis]
        ac = corners[2, axis] - corners[0, axis]
        d1 += ab * (p[axis] - corners[0, axis])
        d2 += ac * (p[axis] - corners[0, axis])
        d3 += ab * (p[axis] - corners[1, axis])
        d4 += ac * (p[axis] - corners[1, axis])
        d5 += ab * (p[axis] - corners[2, axis])
        d6 += ac * (p[axis] - corners[2, axis])
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    weights[0], weights[1], weights[2] = 0.0, 0.0, 0.0
    if d1 <= 0 and d2 <= 0:
        weights[0] = 1.0
    elif d3 >= 0 and d4 <= d3:
        weights[1] = 1.0
    elif d6 >= 0 and d5 <= d6:
        weights[2] = 1.0
    elif vc <= 0 and d1 >= 0 and d3 <= 0:
        weights[1] = d1 / (d1 - d3)
        weights[0] = 1 - weights[1]
    elif vb <= 0 and d2 >= 0 and d6 <= 0:
        weights[2] = d2 / (d2 - d6)
        weights[0] = 1 - weights[2]
    elif va <= 0 and d4 >= d3 and d5 >= d6:
        weights[2] = (d4 - d3) / (d4 - d3 + d5 - d6)
        weights[1] = 1 - weights[2]
    else:
        total = va + vb + vc
        weights[0], weights[1], weights[2] = va / total, vb / total, vc / total
    squared = 0.0
    for axis in range(3):
        x = 0.0
        for k in range(3):
            x += weights[k] * corners[k, axis]
        squared += (x - p[axis]) ** 2
    return squared
