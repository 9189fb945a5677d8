"""Planar caps of a mesh across z: moved on along it, and filled with even triangles."""

from __future__ import annotations

from typing import Any, cast

import manifold3d
import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import Delaunay, cKDTree

from cccd.geometry.arrays import FloatArray, IntArray
from cccd.geometry.mesh import Mesh
from cccd.surface.tessellation import SAME_POINT_MM

__all__ = ["even_cap", "fill_rim", "run_on"]

#: Points within a cap keep so many edges away from its rim: no side of the rim then lies in a triangle.
_FROM_RIM = 0.75
#: Share by which a cap's area may change.
_SAME_AREA = 1e-6


def run_on(mesh: Mesh, cap: float, end: float) -> Mesh:
    """Lengthen a closed mesh straight along z from its planar cap at one height in mm to another.

    Examples
    --------
    >>> import trimesh
    >>> box = trimesh.creation.box()
    >>> box = Mesh(box.vertices, box.faces)
    >>> float(run_on(box, 0.5, 2.5).volume), float(run_on(box, -0.5, -1.5).volume)
    (3.0, 2.0)
    """
    count = len(mesh.vertices)
    flat = (np.abs(mesh.vertices[:, 2] - cap) <= SAME_POINT_MM)[mesh.faces].all(axis=1)
    on_cap = np.unique(mesh.faces[flat])
    raised = mesh.vertices[on_cap]
    raised[:, 2] = end
    above = np.zeros(count, np.int64)
    above[on_cap] = count + np.arange(len(on_cap))
    low = _rim(mesh.faces[flat], count)
    high = above[low]
    walls = [np.column_stack([low, high[:, 1]]), np.column_stack([low[:, 0], high[:, ::-1]])]
    faces = np.concatenate([mesh.faces[~flat], above[mesh.faces[flat]], *walls])
    return Mesh(np.concatenate([mesh.vertices, raised]), faces)


def even_cap(mesh: Mesh, height: float, edge: float) -> Mesh:
    """Give a planar cap even triangles in place of those that span it from rim to rim.

    It stays as it is where the Delaunay triangles of its points do not keep to its rim.

    Parameters
    ----------
    mesh : Mesh
        Closed.
    height : float
        Of the cap in mm: faces are its if all their vertices have this z.
    edge : float
        Edge length in mm that the triangles aim at.

    Examples
    --------
    >>> import trimesh
    >>> tin = trimesh.creation.cylinder(10, 4, sections=60)
    >>> tin = Mesh(tin.vertices, tin.faces)
    >>> even = even_cap(tin, 2.0, 1.0)
    >>> even.is_closed_manifold, abs(even.volume - tin.volume) < 1e-6, len(even.faces) > 2 * len(tin.faces)
    (True, True, True)
    """
    flat = (mesh.vertices[:, 2] == height)[mesh.faces].all(axis=1)
    if not flat.any():
        return mesh
    faces = mesh.faces[flat]
    area = _areas(mesh.vertices[:, :2], faces).sum()
    upwards = bool(area > 0)
    rim = _rim(faces if upwards else faces[:, ::-1], len(mesh.vertices))
    on_rim = np.unique(rim)
    corners = np.searchsorted(on_rim, rim)
    points = mesh.vertices[on_rim, :2]
    middles = points[corners].mean(axis=1)
    added = _lattice(np.concatenate([points, middles]), edge)
    points = np.concatenate([points, added])
    triangles = _inside(points, corners)
    if not np.isclose(_areas(points, triangles).sum(), abs(area), rtol=_SAME_AREA):
        return mesh
    number = np.concatenate([on_rim, len(mesh.vertices) + np.arange(len(added))])
    cap = number[triangles if upwards else triangles[:, ::-1]]
    vertices = np.concatenate([mesh.vertices, np.column_stack([added, np.full(len(added), height)])])
    return Mesh(vertices, np.concatenate([mesh.faces[~flat], cap])).compact()


def fill_rim(points: FloatArray, rim: IntArray) -> tuple[FloatArray, IntArray]:
    """Triangles left of a closed rim in the plane, about as large as its sides are long.

    Parameters
    ----------
    points : (R, 2) float64
    rim : (R, 2) int64
        Its sides, each from one of the points to the next; holes run the other way round.

    Returns
    -------
    added : (A, 2) float64
        Points within.
    triangles : (T, 3) int64
        Of the points and the added ones, counter-clockwise.
    """
    corners = points[rim]
    edge = float(np.median(np.linalg.norm(corners[:, 1] - corners[:, 0], axis=1)))
    added = _lattice(np.concatenate([points, corners.mean(axis=1)]), edge)
    triangles = _inside(np.concatenate([points, added]), rim)
    x, y = corners[..., 0], corners[..., 1]
    area = float((x[:, 0] * y[:, 1] - x[:, 1] * y[:, 0]).sum()) / 2
    if np.isclose(_areas(np.concatenate([points, added]), triangles).sum(), area, rtol=_SAME_AREA):
        used = np.union1d(np.arange(len(points)), triangles)
        return added[used[len(points) :] - len(points)], np.searchsorted(used, triangles)
    loops = _loops(rim)
    order = np.concatenate(loops)
    fill = cast(Any, manifold3d).triangulate  # its stubs leave the arrays' types open
    spanned = np.asarray(fill([points[loop] for loop in loops]), np.int64)
    return np.zeros((0, 2)), order[spanned]


def _loops(rim: IntArray) -> list[IntArray]:
    """Split sides (R, 2) into closed chains of points."""
    after = np.zeros(len(rim), np.int64)
    after[rim[:, 0]] = rim[:, 1]
    links = coo_array((np.ones(len(rim), bool), tuple(rim.T)), shape=(len(rim), len(rim)))
    count, part = connected_components(links, directed=False)
    loops: list[IntArray] = []
    for n in range(count):
        start = int(np.argmax(part == n))
        chain = [start]
        while after[chain[-1]] != start:
            chain.append(int(after[chain[-1]]))
        loops.append(np.array(chain))
    return loops


def _lattice(rim: FloatArray, edge: float) -> FloatArray:
    """Corners (P, 2) of equilateral triangles around points (R, 2) of a rim, none of them near to it."""
    low, step = rim.min(axis=0), np.array([edge, edge * np.sqrt(3) / 2])
    count = np.ceil((rim.max(axis=0) - low) / step).astype(np.int64)
    places = np.indices((int(count[0]), int(count[1]))).reshape(2, -1).T.astype(np.float64)
    places[:, 0] += places[:, 1] % 2 / 2
    places = low + places * step
    away = np.asarray(cKDTree(rim).query(places)[0])
    return places[away >= _FROM_RIM * edge]


def _inside(points: FloatArray, rim: IntArray) -> IntArray:
    """Delaunay triangles (T, 3), counter-clockwise, left of a rim's sides (R, 2); none if one is missing."""
    triangles = np.asarray(Delaunay(points).simplices, np.int64)
    clockwise = _areas(points, triangles) < 0
    triangles[clockwise] = triangles[clockwise][:, ::-1]
    count, owner = len(points), np.repeat(np.arange(len(triangles)), 3)
    sides = _sides(triangles)
    keys, back, wanted = _keys(sides, count), _keys(sides[:, ::-1], count), _keys(rim, count)
    if not np.isin(wanted, keys).all():
        return np.zeros((0, 3), np.int64)
    order = np.argsort(keys)
    opposite = order[np.minimum(np.searchsorted(keys, back, sorter=order), len(keys) - 1)]
    linked = (keys[opposite] == back) & ~np.isin(keys, wanted) & ~np.isin(back, wanted)
    links = coo_array(
        (np.ones(int(linked.sum()), bool), (owner[linked], owner[opposite[linked]])),
        shape=(len(triangles), len(triangles)),
    )
    part = connected_components(links, directed=False)[1]
    return triangles[np.isin(part, part[owner[np.isin(keys, wanted)]])]


def _rim(faces: IntArray, count: int) -> IntArray:
    """Directed sides (R, 2) of triangles of ``count`` vertices that have no other triangle beside them."""
    sides = _sides(faces)
    return sides[~np.isin(_keys(sides, count), _keys(sides[:, ::-1], count))]


def _sides(faces: IntArray) -> IntArray:
    """Directed sides (3 F, 2) of triangles, one triangle's after another's."""
    return faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)


def _keys(sides: IntArray, count: int) -> IntArray:
    """One number (E,) for each directed side (E, 2) between ``count`` vertices."""
    return sides[:, 0] * count + sides[:, 1]


def _areas(points: FloatArray, triangles: IntArray) -> FloatArray:
    """Areas (T,) of triangles of plane points (P, 2), positive if counter-clockwise."""
    first, second = (points[triangles[:, n]] - points[triangles[:, 0]] for n in (1, 2))
    return (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / 2
