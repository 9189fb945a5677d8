"""The bodies of a closed mesh: each an outer surface, and the surfaces of the cavities in it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cccd.geometry.arrays import FloatArray
from cccd.geometry.distance import to_mesh
from cccd.geometry.mesh import Mesh

#: A cavity of this share of the largest body may have been turned inside out by rounding.
SPECK = 1e-4


def split_bodies(mesh: Mesh) -> list[list[Mesh]]:
    """Split a closed mesh into bodies, largest first: an outer piece each, then the cavities in it.

    A piece of negative volume is a cavity of the smallest body that holds it.

    Raises
    ------
    ValueError
        When a cavity lies in no body.

    Examples
    --------
    >>> import trimesh
    >>> large, small = (trimesh.creation.icosphere(2, radius) for radius in (10, 4))
    >>> cavity = trimesh.Trimesh(small.vertices, small.faces[:, ::-1], process=False)
    >>> both = trimesh.util.concatenate([large, cavity])
    >>> ((outer, inner),) = split_bodies(Mesh(np.array(both.vertices), np.array(both.faces, np.int64)))
    >>> outer.volume > 0, inner.volume < 0
    (True, True)
    """
    pieces = sorted(mesh.pieces(), key=lambda piece: -piece.volume)
    return [[pieces[n] for n in body] for body in nest_pieces(pieces)]


def nest_pieces(pieces: Sequence[Mesh]) -> list[list[int]]:
    """Find which pieces make up a body: numbers of its outer one and of its cavities, largest bodies first.

    Raises
    ------
    ValueError
        When a cavity lies in no body, but for specks: these are left out.
    """
    volumes = [piece.volume for piece in pieces]
    order = sorted(range(len(pieces)), key=lambda n: -volumes[n])
    bodies = [[n] for n in order if volumes[n] > 0]
    for n in order[len(bodies) :]:
        inside = pieces[n].vertices[pieces[n].faces[0, 0]]
        holding = [body for body in bodies if _holds(pieces[body[0]], inside)]
        if holding:
            holding[-1].append(n)
        elif -volumes[n] > SPECK * max(volumes):
            raise ValueError("a cavity lies outside all bodies: the mesh is no closed solid")
    return bodies


def _holds(mesh: Mesh, point: FloatArray) -> bool:
    """Whether a point (3,) lies inside a closed mesh."""
    if np.any(point < mesh.vertices.min(axis=0)) or np.any(point > mesh.vertices.max(axis=0)):
        return False
    return bool(to_mesh(point[None], mesh)[0] < 0)
