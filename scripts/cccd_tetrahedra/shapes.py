"""Single tetrahedra: faces, volumes, angles, shapes."""

from __future__ import annotations

from typing import Any, cast

import numpy as np

from cccd.geometry.arrays import FloatArray

#: Corners of a tetrahedron's faces, counter-clockwise seen from outside, in the order of Abaqus' S1 to S4.
FACES = np.array([(0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)])

#: Pairs of faces of a tetrahedron: its six edges.
_PAIRS = np.array([(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)])


def signed_volumes(corners: FloatArray) -> FloatArray:
    """Volume (N,) of tetrahedra (N, 4, 3), positive where the fourth vertex lies above the first three.

    Above is where the normal of the first three, counter-clockwise, points to.
    """
    return np.linalg.det(corners[:, 1:] - corners[:, :1]) / 6


def dihedral_angles(corners: FloatArray) -> FloatArray:
    """Angles (N, 6) in degrees between the faces of tetrahedra (N, 4, 3).

    Examples
    --------
    >>> regular = np.array([[(1.0, 1, 1), (-1, -1, 1), (-1, 1, -1), (1, -1, -1)]])
    >>> dihedral_angles(regular).round(2).tolist()
    [[70.53, 70.53, 70.53, 70.53, 70.53, 70.53]]
    """
    a, b, c = (corners[:, FACES[:, n]] for n in range(3))
    normals = np.cross(b - a, c - a)
    first, second = normals[:, _PAIRS[:, 0]], normals[:, _PAIRS[:, 1]]
    sine = np.linalg.norm(np.cross(first, second), axis=-1)
    return np.degrees(np.arctan2(sine, -np.einsum("nec,nec->ne", first, second)))


def radius_ratios(corners: FloatArray) -> FloatArray:
    """Three times the inscribed by the circumscribed sphere's radius (N,): 1 is regular, 0 is flat."""
    return 1 / _measured_by_vtk("radius_ratio", corners)


def scaled_jacobians(corners: FloatArray) -> FloatArray:
    """Volume by the longest three edges at a corner (N,): 1 is regular, 0 is flat."""
    return _measured_by_vtk("scaled_jacobian", corners)


def _measured_by_vtk(measure: str, corners: FloatArray) -> FloatArray:
    import pyvista  # VTK takes a second to load

    cells = {pyvista.CellType.TETRA: np.arange(4 * len(corners)).reshape(-1, 4)}
    grid = cast(Any, pyvista.UnstructuredGrid(cells, corners.reshape(-1, 3)))
    return np.asarray(grid.cell_quality(measure)[measure], float)
