"""Solids from tubes: union of what is solid, minus cavities, plus what floats inside them.

The booleans are manifold3d's.
"""

from __future__ import annotations

from collections.abc import Sequence

import manifold3d
import numpy as np
from manifold3d import Manifold, OpType

__all__ = ["combine", "solid", "triangles"]


def solid(vertices: np.ndarray, faces: np.ndarray) -> Manifold:
    """Turn a closed mesh (V, 3), (F, 3) into a solid that remembers which faces are its own."""
    mesh = manifold3d.Mesh64(
        np.ascontiguousarray(vertices, float),
        np.ascontiguousarray(faces, np.uint64),
        run_index=np.array([0, faces.size], np.uint64),
        run_original_id=np.array([Manifold.reserve_ids(1)], np.uint32),
    )
    return Manifold(mesh)


def triangles(body: Manifold) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices (V, 3) float64 and faces (F, 3) int64 of a solid, and which original each face is from."""
    mesh = body.to_mesh64()
    faces = np.array(mesh.tri_verts, np.int64)
    bounds = np.array(mesh.run_index, np.int64) // 3
    origin = np.repeat(np.array(mesh.run_original_id, np.int64), np.diff(bounds))
    return np.array(mesh.vert_properties[:, :3], float), faces, origin


def combine(bodies: Sequence[Manifold], holes: Sequence[bool], depths: Sequence[int]) -> Manifold:
    """Union and difference in the order in which the rings nest.

    Outlines (depth 0) are joined, their holes (depth 1) taken away, islands in holes (depth 2) added,
    and so on.
    """
    whole = Manifold()
    for depth in sorted(set(depths)):
        for hole in (False, True):
            layer = [
                body
                for body, is_hole, its_depth in zip(bodies, holes, depths, strict=True)
                if its_depth == depth and is_hole == hole
            ]
            if layer:
                joined = Manifold.batch_boolean(layer, OpType.Add)
                whole = whole - joined if hole else whole + joined
    return whole
