"""The bodies of a closed mesh: each an outer surface, and the surfaces of the cavities in it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cccd.geometry.arrays import FloatArray
from cccd.geometry.distance import to_mesh
from cccd.geometry.mesh import Mesh

__all__ = ["Body", "split_bodies"]


@dataclass(frozen=True)
class Body:
    """One body.

    Attributes
    ----------
    outer : Mesh
        Closed, in one piece, counter-clockwise from outside.
    cavities : tuple of Mesh
        Likewise, counter-clockwise from inside the cavity: their volumes are negative.
    """

    outer: Mesh
    cavities: tuple[Mesh, ...] = ()


def split_bodies(mesh: Mesh) -> list[Body]:
    """Split a closed mesh into bodies, largest first.

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
    >>> (body,) = split_bodies(Mesh(np.array(both.vertices), np.array(both.faces, np.int64)))
    >>> len(body.cavities), body.cavities[0].volume < 0
    (1, True)
    """
    pieces = sorted(mesh.pieces(), key=lambda piece: -piece.volume)
    outers = [piece for piece in pieces if piece.volume > 0]
    cavities: list[list[Mesh]] = [[] for _ in outers]
    for piece in pieces[len(outers) :]:
        holding = [n for n, outer in enumerate(outers) if _holds(outer, piece.vertices[piece.faces[0, 0]])]
        if not holding:
            raise ValueError("a cavity lies outside all bodies: the mesh is no closed solid")
        cavities[holding[-1]].append(piece)
    return [Body(outer, tuple(inside)) for outer, inside in zip(outers, cavities, strict=True)]


def _holds(mesh: Mesh, point: FloatArray) -> bool:
    """Whether a point (3,) lies inside a closed mesh."""
    if np.any(point < mesh.vertices.min(axis=0)) or np.any(point > mesh.vertices.max(axis=0)):
        return False
    return bool(to_mesh(point[None], mesh)[0] < 0)
