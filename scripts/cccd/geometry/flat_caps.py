"""Cuts by planes: closed meshes are cut by manifold3d, and the rims of cuts filled with triangles.

Triangles grow away from a rim: what is flat needs few.
"""

from __future__ import annotations

from typing import Any, cast

import manifold3d
import numpy as np
from manifold3d import Manifold
from scipy.spatial import Delaunay, cKDTree

from cccd.geometry.arrays import FloatArray, IntArray, connected_parts
from cccd.geometry.mesh import Mesh


def between_planes(mesh: Mesh, low: float, high: float) -> Mesh:
    """Cut a closed mesh by planes across z, and close it by planar caps.

    Parameters
    ----------
    mesh : Mesh
    low, high : float
        Heights of the planes in mm, without a plane infinite; vertices on them stay where they are.
    """
    body = manifold_of(mesh)
    if np.isfinite(low):
        body = body.trim_by_plane((0, 0, 1), low)
    if np.isfinite(high):
        body = body.trim_by_plane((0, 0, -1), -high)
    return mesh_of(body)


def manifold_of(mesh: Mesh) -> Manifold:
    """Turn a closed mesh into a solid."""
    vertices, faces = np.ascontiguousarray(mesh.vertices, float), np.ascontiguousarray(mesh.faces, np.uint64)
    return Manifold(manifold3d.Mesh64(vertices, faces))


def mesh_of(body: Manifold) -> Mesh:
    """Mesh of a solid."""
    mesh = cast(Any, body.to_mesh64())  # its stubs leave the arrays' types open
    return Mesh(np.array(mesh.vert_properties[:, :3], float), np.array(mesh.tri_verts, np.int64))


#: Points within a cap keep so many edges away from its rim: no side of the rim then lies in a triangle.
_FROM_RIM = 0.75
#: Edges grow by this share of their distance from the rim.
_GROWTH = 0.6
#: The shortest edges, in medians: a rim's tiny sides do not fill the cap.
_SHORTEST = 0.25
#: Share by which a cap's area may change.
_SAME_AREA = 1e-6


def fill_rim(
    points: FloatArray, rim: IntArray, within: FloatArray | None = None
) -> tuple[FloatArray, IntArray]:
    """Triangles left of a closed rim in the plane, beside it about as large as its sides are long.

    Parameters
    ----------
    points : (R, 2) float64
    rim : (R, 2) int64
        Its sides, each from one of the points to the next; holes run the other way round.
    within : (P, 2) float64, optional
        Points to be added, in place of those that make triangles grow away from the rim.

    Returns
    -------
    added : (A, 2) float64
        Points within.
    triangles : (T, 3) int64
        Of the points and the added ones, counter-clockwise.
    """
    corners = points[rim]
    added = _lattices(corners) if within is None else within
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
    """Split sides (R, 2) into closed chains of points, which may meet."""
    after: dict[int, list[int]] = {}
    for start, end in rim.tolist():
        after.setdefault(start, []).append(end)
    loops: list[IntArray] = []
    for start in after:
        while after[start]:
            chain = [start]
            while (point := after[chain[-1]].pop()) != start:
                chain.append(point)
            loops.append(np.array(chain))
    return loops


def _lattices(sides: FloatArray) -> FloatArray:
    """Points (P, 2) around the sides (R, 2, 2) of a rim, none of them near to it."""
    length = np.tile(np.linalg.norm(sides[:, 1] - sides[:, 0], axis=1), 3)
    rim = np.concatenate([*sides.swapaxes(0, 1), sides.mean(axis=1)])
    tree = cKDTree(rim)
    median, extent = np.median(length), float(np.ptp(rim, axis=0).max())
    step = max(float(length.min()), _SHORTEST * float(median))
    kept = [np.zeros((0, 2))]  # a rim may be too small for any
    least = 0.0
    while step <= extent:
        places = _lattice(rim, step)
        away, nearest = tree.query(places)
        edge = length[nearest] + _GROWTH * np.asarray(away)
        kept.append(places[(away >= _FROM_RIM * length[nearest]) & (edge >= least) & (edge < 2 * step)])
        step, least = 2 * step, 2 * step
    return np.concatenate(kept)


def _lattice(rim: FloatArray, edge: float) -> FloatArray:
    """Corners (P, 2) of equilateral triangles over the box of points (R, 2)."""
    # beside the rim's corner: no point lies in line with a side of the rim
    low, step = rim.min(axis=0) - edge / np.array([np.pi, np.e]), np.array([edge, edge * np.sqrt(3) / 2])
    count = np.ceil((rim.max(axis=0) - low) / step).astype(np.int64)
    places = np.indices((int(count[0]), int(count[1]))).reshape(2, -1).T.astype(np.float64)
    places[:, 0] += places[:, 1] % 2 / 2
    return low + places * step


def _inside(points: FloatArray, rim: IntArray) -> IntArray:
    """Delaunay triangles (T, 3), counter-clockwise, left of a rim's sides (R, 2); none if one is missing."""
    triangles = np.asarray(Delaunay(points).simplices, np.int64)  # counter-clockwise, also without area
    count, owner = len(points), np.repeat(np.arange(len(triangles)), 3)
    sides = triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    keys, back, wanted = _keys(sides, count), _keys(sides[:, ::-1], count), _keys(rim, count)
    if not np.isin(wanted, keys).all():
        return np.zeros((0, 3), np.int64)
    order = np.argsort(keys)
    opposite = order[np.minimum(np.searchsorted(keys, back, sorter=order), len(keys) - 1)]
    linked = (keys[opposite] == back) & ~np.isin(keys, wanted) & ~np.isin(back, wanted)
    part = connected_parts(owner[linked], owner[opposite[linked]], len(triangles))
    return triangles[np.isin(part, part[owner[np.isin(keys, wanted)]])]


def _keys(sides: IntArray, count: int) -> IntArray:
    """One number (E,) for each directed side (E, 2) between ``count`` vertices."""
    return sides[:, 0] * count + sides[:, 1]


def _areas(points: FloatArray, triangles: IntArray) -> FloatArray:
    """Areas (T,) of triangles of plane points (P, 2), positive if counter-clockwise."""
    first, second = (points[triangles[:, n]] - points[triangles[:, 0]] for n in (1, 2))
    return (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / 2
