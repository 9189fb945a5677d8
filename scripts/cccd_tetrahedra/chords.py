"""Boundary vertices moved by what the chords between them cut off, so that organs keep their volume."""

from __future__ import annotations

import numpy as np

from cccd.geometry.arrays import BoolArray, FloatArray, IntArray, unit_vectors
from cccd.geometry.distance import to_mesh
from cccd.geometry.mesh import Mesh
from cccd.tolerances import TINY
from cccd_tetrahedra.shapes import radius_ratios, signed_volumes

#: A tetrahedron keeps at least this share of its radius ratio; otherwise its vertices stay.
LEAST_SHARE = 0.7

#: Mean over a triangle of what is quadratic there: of its value in the middle, the rest of its corners' mean.
MIDDLE_SHARE = 0.75


def balance_chords(
    vertices: FloatArray, tetrahedra: IntArray, triangles: IntArray, surface: Mesh, fixed: BoolArray
) -> FloatArray:
    """Move the vertices of a closed boundary so that as much of it lies outside its surface as inside.

    Mesh generators put vertices on the surface, so that faces are its chords: on a ball all cut off some of
    the volume. Each vertex moves along its normal by the mean distance of its faces from the surface.

    Parameters
    ----------
    vertices : (V, 3) float64
    tetrahedra : (N, 4) int64
        None of them turns inside out, or becomes much flatter.
    triangles : (T, 3) int64
        Of the boundary, counter-clockwise seen from outside.
    surface : Mesh
        Closed.
    fixed : (V,) bool
        Vertices that stay.

    Returns
    -------
    (V, 3) float64
    """
    used = np.unique(triangles)
    at_corners = np.zeros(len(vertices))
    at_corners[used] = to_mesh(vertices[used], surface)
    middle = to_mesh(vertices[triangles].mean(axis=1), surface)
    outside = MIDDLE_SHARE * middle + (1 - MIDDLE_SHARE) * at_corners[triangles].mean(axis=1)
    normals = Mesh(vertices, triangles).face_normals
    area = np.linalg.norm(normals, axis=1)

    def gathered(values: FloatArray) -> FloatArray:
        return np.bincount(triangles.ravel(), np.repeat(values, 3), len(vertices)).astype(float)

    along = unit_vectors(np.stack([gathered(column) for column in normals.T], axis=1))
    step = -gathered(outside * area) / np.maximum(gathered(area), TINY)
    step[fixed] = 0.0
    moved = vertices + step[:, None] * along
    return unspoiled(vertices, moved, tetrahedra)


def unspoiled(vertices: FloatArray, moved: FloatArray, tetrahedra: IntArray) -> FloatArray:
    """Leave vertices (V, 3) where they were in tetrahedra (N, 4) that their move would invert or flatten."""
    before = radius_ratios(vertices[tetrahedra])
    kept = moved.copy()
    while True:
        after = np.where(signed_volumes(kept[tetrahedra]) > 0, radius_ratios(kept[tetrahedra]), 0.0)
        corners = np.unique(tetrahedra[after < LEAST_SHARE * before])
        if np.array_equal(kept[corners], vertices[corners]):
            return kept
        kept[corners] = vertices[corners]
