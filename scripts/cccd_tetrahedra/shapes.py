"""Single tetrahedra: faces, volumes, angles, shapes."""

from __future__ import annotations

import numpy as np

from cccd.geometry.arrays import FloatArray, IntArray

__all__ = ["FACES", "dihedral_angles", "radius_ratios", "scaled_jacobians", "signed_volumes"]

#: Corners of a tetrahedron's faces, counter-clockwise seen from outside, in the order of Abaqus' S1 to S4.
FACES = np.array([(0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)])

#: Pairs of faces of a tetrahedron: its six edges.
_PAIRS = np.array([(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)])


def signed_volumes(vertices: FloatArray, tetrahedra: IntArray) -> FloatArray:
    """Volume (N,) of tetrahedra, positive where the fourth vertex lies above the first three.

    Above is where the normal of the first three, counter-clockwise, points to.
    """
    a, b, c, d = (vertices[tetrahedra[:, n]] for n in range(4))
    return np.einsum("nc,nc->n", b - a, np.cross(c - a, d - a)) / 6


def dihedral_angles(corners: FloatArray) -> FloatArray:
    """Angles (N, 6) in degrees between the faces of tetrahedra (N, 4, 3).

    Examples
    --------
    >>> regular = np.array([[(1.0, 1, 1), (-1, -1, 1), (-1, 1, -1), (1, -1, -1)]])
    >>> dihedral_angles(regular).round(2).tolist()
    [[70.53, 70.53, 70.53, 70.53, 70.53, 70.53]]
    """
    normals = _doubled_normals(corners)
    first, second = normals[:, _PAIRS[:, 0]], normals[:, _PAIRS[:, 1]]
    sine = np.linalg.norm(np.cross(first, second), axis=-1)
    return np.degrees(np.arctan2(sine, -np.einsum("nec,nec->ne", first, second)))


def radius_ratios(corners: FloatArray) -> FloatArray:
    """Three times the inscribed by the circumscribed sphere's radius (N,): 1 is regular, 0 is flat.

    Examples
    --------
    >>> regular = np.array([[(1.0, 1, 1), (-1, -1, 1), (-1, 1, -1), (1, -1, -1)]])
    >>> radius_ratios(regular).round(9).tolist()
    [1.0]
    """
    volume = np.abs(signed_volumes(corners.reshape(-1, 3), np.arange(4 * len(corners)).reshape(-1, 4)))
    area = np.linalg.norm(_doubled_normals(corners), axis=-1).sum(axis=1) / 2
    a, b, c = (corners[:, n] - corners[:, 0] for n in (1, 2, 3))
    spanned = (
        (a**2).sum(1, keepdims=True) * np.cross(b, c)
        + (b**2).sum(1, keepdims=True) * np.cross(c, a)
        + (c**2).sum(1, keepdims=True) * np.cross(a, b)
    )
    # r = 3 V / A and R = |spanned| / (12 V)
    around = area * np.linalg.norm(spanned, axis=1)
    return np.divide(108 * volume**2, around, out=np.zeros_like(volume), where=around > 0)


def scaled_jacobians(corners: FloatArray) -> FloatArray:
    """Volume by the longest three edges at a corner (N,), as VTK scales it: 1 is regular, 0 is flat.

    Examples
    --------
    >>> regular = np.array([[(1.0, 1, 1), (-1, -1, 1), (-1, 1, -1), (1, -1, -1)]])
    >>> scaled_jacobians(regular).round(9).tolist()
    [1.0]
    """
    volume = signed_volumes(corners.reshape(-1, 3), np.arange(4 * len(corners)).reshape(-1, 4))
    between = np.linalg.norm(corners[:, :, None] - corners[:, None], axis=-1)
    between[:, range(4), range(4)] = 1  # no edge
    most = between.prod(axis=-1).max(axis=-1)
    return np.divide(np.sqrt(2) * 6 * volume, most, out=np.zeros_like(volume), where=most > 0)


def _doubled_normals(corners: FloatArray) -> FloatArray:
    """Outer normals (N, 4, 3) of the faces of tetrahedra, as long as twice their areas."""
    a, b, c = (corners[:, FACES[:, n]] for n in range(3))
    return np.cross(b - a, c - a)
