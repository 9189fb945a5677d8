"""Booleans of closed meshes, by manifold3d."""

from __future__ import annotations

import manifold3d
from manifold3d import Manifold

from cccd.geometry.flat_caps import manifold_of, mesh_of
from cccd.geometry.mesh import Mesh


def shared_volume(first: Mesh, second: Mesh) -> float | None:
    """Volume that two closed meshes have in common; None where one of them bounds no solid.

    Examples
    --------
    >>> import numpy as np
    >>> corner = np.array([(0.0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)])
    >>> tetrahedron = Mesh(corner, np.array([(0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)]))
    >>> round(6 * shared_volume(tetrahedron, Mesh(corner + (0.5, 0, 0), tetrahedron.faces)), 9)
    0.125
    """
    bodies = [manifold_of(mesh) for mesh in (first, second)]
    if any(body.status() != manifold3d.Error.NoError for body in bodies):
        return None
    return float((bodies[0] ^ bodies[1]).volume())


def united(mesh: Mesh) -> Mesh | None:
    """Unite the pieces of a closed mesh that overlap, less its cavities; None where it bounds no solid."""
    whole = manifold_of(mesh)
    if whole.status() != manifold3d.Error.NoError:
        return None
    pieces = [(piece, piece.volume) for piece in mesh.pieces()]
    solid = Manifold.batch_boolean(
        [manifold_of(piece) for piece, volume in pieces if volume > 0], manifold3d.OpType.Add
    )
    for piece, volume in pieces:
        if volume < 0:
            solid -= manifold_of(piece.reversed())
    return mesh_of(solid)
