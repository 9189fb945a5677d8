"""Cuts by planes: closed meshes are cut by manifold3d, and the rims of cuts filled with triangles."""

from __future__ import annotations

from typing import Any, cast

import manifold3d
import numpy as np
from manifold3d import Manifold

from cccd.geometry.arrays import FloatArray, IntArray
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


def fill_rim(points: FloatArray, rim: IntArray) -> IntArray:
    """Triangles (T, 3), counter-clockwise, left of a closed rim in the plane.

    Parameters
    ----------
    points : (R, 2) float64
    rim : (R, 2) int64
        Its sides, each from one of the points to the next; holes run the other way round.
    """
    loops = _loops(rim)
    fill = cast(Any, manifold3d).triangulate  # its stubs leave the arrays' types open
    return np.concatenate(loops)[np.asarray(fill([points[loop] for loop in loops]), np.int64)]


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
