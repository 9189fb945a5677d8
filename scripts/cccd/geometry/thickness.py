"""How thick the walls of a closed mesh are, and where lines meet it."""

from __future__ import annotations

from typing import Any

import numpy as np

from cccd.geometry._vtk import vtk
from cccd.geometry.arrays import FloatArray
from cccd.geometry.mesh import Mesh

__all__ = ["first_hit", "locator", "wall_thickness"]

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
    tree = locator(mesh)
    ends = start + reach * inwards
    hits = [first_hit(tree, point, end) for point, end in zip(start, ends, strict=True)]
    return float(np.quantile(np.linalg.norm(hits - start, axis=1), share))


def locator(mesh: Mesh) -> Any:
    """Put the triangles of a mesh into a tree for `first_hit`."""
    tree = vtk("vtkCommonDataModel").vtkStaticCellLocator()
    tree.SetDataSet(mesh.to_vtk())
    tree.BuildLocator()
    return tree


def first_hit(tree: Any, start: FloatArray, end: FloatArray) -> FloatArray:
    """Point (3,) at which a line first meets a located mesh; its end where it meets none."""
    share, found, parameters = _reference(0.0), [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]
    met = tree.IntersectWithLine(start, end, 0.0, share, found, parameters, _reference(0))
    return np.array(found) if met else end


def _reference(value: float) -> Any:
    """Return a number that VTK can write to."""
    return vtk("vtkCommonCore").reference(value)
