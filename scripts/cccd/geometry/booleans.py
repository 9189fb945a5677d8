"""Booleans of closed meshes, by manifold3d: cuts by planes, common volumes."""

from __future__ import annotations

from typing import Any, cast

import manifold3d
import numpy as np
from manifold3d import Manifold

from cccd.geometry.mesh import Mesh


def between_planes(mesh: Mesh, low: float, high: float) -> Mesh:
    """Cut a closed mesh by planes across z, and close it by planar caps.

    Parameters
    ----------
    mesh : Mesh
    low, high : float
        Heights of the planes in mm, without a plane infinite; vertices on them stay where they are.
    """
    body = _manifold(mesh)
    if np.isfinite(low):
        body = body.trim_by_plane((0, 0, 1), low)
    if np.isfinite(high):
        body = body.trim_by_plane((0, 0, -1), -high)
    return _triangles(body)


def shared_volume(first: Mesh, second: Mesh) -> float | None:
    """Volume that two closed meshes have in common; None where one of them bounds no solid.

    Examples
    --------
    >>> corner = np.array([(0.0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)])
    >>> tetrahedron = Mesh(corner, np.array([(0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)]))
    >>> round(6 * shared_volume(tetrahedron, Mesh(corner + (0.5, 0, 0), tetrahedron.faces)), 9)
    0.125
    """
    bodies = [_manifold(mesh) for mesh in (first, second)]
    if any(body.status() != manifold3d.Error.NoError for body in bodies):
        return None
    return float((bodies[0] ^ bodies[1]).volume())


def united(mesh: Mesh) -> Mesh | None:
    """Unite the pieces of a closed mesh that overlap, less its cavities; None where it bounds no solid."""
    whole = _manifold(mesh)
    if whole.status() != manifold3d.Error.NoError:
        return None
    pieces = [(piece, piece.volume) for piece in mesh.pieces()]
    solid = Manifold.batch_boolean(
        [_manifold(piece) for piece, volume in pieces if volume > 0], manifold3d.OpType.Add
    )
    for piece, volume in pieces:
        if volume < 0:
            solid -= _manifold(piece.reversed())
    return _triangles(solid)


def _manifold(mesh: Mesh) -> Manifold:
    """Turn a closed mesh into a solid."""
    vertices, faces = np.ascontiguousarray(mesh.vertices, float), np.ascontiguousarray(mesh.faces, np.uint64)
    return Manifold(manifold3d.Mesh64(vertices, faces))


def _triangles(body: Manifold) -> Mesh:
    """Mesh of a solid."""
    mesh = cast(Any, body.to_mesh64())  # its stubs leave the arrays' types open
    return Mesh(np.array(mesh.vert_properties[:, :3], float), np.array(mesh.tri_verts, np.int64))
