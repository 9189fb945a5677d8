"""Solids from tubes: union of what is solid, minus cavities, plus what floats inside them.

The booleans are manifold3d's.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol, cast

import manifold3d
import numpy as np
from manifold3d import Manifold, OpType

from cccd.geometry.mesh import Mesh

__all__ = ["Nesting", "between_planes", "unite"]


class Nested(Protocol):
    """What is known of where a tube lies."""

    @property
    def depth(self) -> int:
        """How many tubes it lies in."""
        ...

    @property
    def hole(self) -> bool:
        """Whether it bounds a hole."""
        ...


class Nesting(NamedTuple):
    """The place of a tube of which nothing else is known."""

    depth: int
    hole: bool


def unite(meshes: Sequence[Mesh], tubes: Sequence[Nested]) -> Mesh:
    """Unite the closed meshes of some tubes in the order in which their rings nest.

    Outlines (depth 0) are joined, their holes (depth 1) taken away, islands in holes (depth 2) added,
    and so on. Where holes take everything away the first tube is left. The mesh is closed.
    """
    bodies = [_manifold(mesh) for mesh in meshes]
    whole = Manifold()
    for depth in sorted({tube.depth for tube in tubes}):
        for hole in (False, True):
            layer = [
                body
                for body, tube in zip(bodies, tubes, strict=True)
                if tube.depth == depth and tube.hole == hole
            ]
            if layer:
                joined = Manifold.batch_boolean(layer, OpType.Add)
                whole = whole - joined if hole else whole + joined
    return _triangles(bodies[0] if whole.is_empty() else whole)


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


def _manifold(mesh: Mesh) -> Manifold:
    """Turn a closed mesh into a solid."""
    vertices, faces = np.ascontiguousarray(mesh.vertices, float), np.ascontiguousarray(mesh.faces, np.uint64)
    return Manifold(manifold3d.Mesh64(vertices, faces))


def _triangles(body: Manifold) -> Mesh:
    """Mesh of a solid."""
    mesh = cast(Any, body.to_mesh64())  # its stubs leave the arrays' types open
    return Mesh(np.array(mesh.vert_properties[:, :3], float), np.array(mesh.tri_verts, np.int64))
