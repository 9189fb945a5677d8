"""How thick the walls of a closed mesh are."""

from __future__ import annotations

import numpy as np

from cccd.geometry.mesh import Mesh
from cccd.geometry.triangle_tree import TriangleTree

__all__ = ["wall_thickness"]

#: Rays that are cast into a mesh.
RAYS = 2000
#: A ray starts so far below its triangle, in mm: not to meet that again.
BELOW_MM = 1e-4


def wall_thickness(mesh: Mesh, share: float) -> float:
    """Thickness in mm which a share of a closed mesh's surface falls short of: 0 the thinnest wall of all.

    It is measured along rays from random points straight inwards.

    Examples
    --------
    >>> import trimesh
    >>> plate = trimesh.creation.box((30, 40, 2))
    >>> round(wall_thickness(Mesh(plate.vertices, plate.faces), 0.01), 2)
    2.0
    """
    rng = np.random.default_rng(0)
    face = rng.choice(len(mesh.faces), RAYS, p=mesh.face_areas / mesh.face_areas.sum())
    inwards = -mesh.unit_normals[face]
    start = mesh.vertices[mesh.faces[face]].mean(axis=1) + BELOW_MM * inwards
    reach = float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))
    ends = start + reach * inwards
    return float(np.quantile(reach * TriangleTree(mesh).first_hits(start, ends), share))
