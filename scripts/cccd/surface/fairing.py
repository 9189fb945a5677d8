"""The grid's ripples taken off a mesh, and nothing of its shape."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cccd.geometry.arrays import FloatArray
from cccd.geometry.averaging import averaging_rounds
from cccd.geometry.mesh import Mesh, given_back
from cccd.settings.surface import BlendingSettings
from cccd.tolerances import ROUNDING

__all__ = ["CELL_EDGES", "fair", "without_crossings"]

#: Cells of the grid on which the surface is meshed, in edges: marching cubes' edges are a little longer.
CELL_EDGES = 0.8
#: Details this many times as high as ripples are surely none.
SURE_DETAIL = 1.8


def fair(
    mesh: Mesh, cell: float, pixel: float, settings: BlendingSettings, of_probability: bool = False
) -> Mesh:
    """Smooth a closed mesh.

    A windowed sinc filter of the positions (Taubin et al. 1996) takes ripples off, and draws branches and
    tips in as well. What it took along the normals is given back but for what is as low as ripples are.

    Parameters
    ----------
    mesh : Mesh
        Isosurface of a grid, mm.
    cell : float
        The grid's, mm.
    pixel : float
        The slices', mm.
    settings : BlendingSettings
        Of these what begins with ``fairing`` and ``regain``.
    of_probability : bool
        Whether the mesh is the level of probabilities, which knows less of ripples.

    Returns
    -------
    Mesh
        The same faces.
    """
    edge_pixels = cell / CELL_EDGES / pixel
    smooth = mesh.low_passed(settings.fairing_band * edge_pixels, settings.fairing_rounds)
    lengths, ripples = settings.regain_pixels, settings.regain_ripples
    if of_probability:
        lengths, ripples = (settings.regain_pixels_probability,), ()
    averagings = [averaging_rounds(length, edge_pixels) for length in lengths]
    heights = pixel * np.array(ripples)
    return given_back(
        mesh,
        smooth,
        lambda lost: _without_ripples(mesh, lost, averagings, heights),
        settings.regain_rounds,
    )


def _without_ripples(
    mesh: Mesh, heights: FloatArray, averagings: Sequence[int], ripples: FloatArray
) -> FloatArray:
    """Average heights (V,) along a mesh over a length, over less where shorter averages show details.

    Between an average and the next longer one lie details of that size. Where their root mean square is that
    of ripples they are left out; wavelet shrinkage does so with coefficients (Donoho and Johnstone 1994).

    Parameters
    ----------
    mesh : Mesh
        Closed.
    heights : (V,) float64
        Along the normals, mm.
    averagings : (L,) int
        Rounds of averaging that make up each length, ascending.
    ripples : (L - 1,) float64
        Root mean square of ripples between each length and the next, mm.
    """
    averages = mesh.averages(heights, averagings)
    kept = averages[-1]
    for shorter, longer, rounds, ripple in zip(averages, averages[1:], averagings[1:], ripples, strict=False):
        details = shorter - longer
        size = np.sqrt(np.maximum(mesh.averages(details**2, [rounds])[0], 0))
        share = np.clip((size / max(ripple, ROUNDING) - 1) / (SURE_DETAIL - 1), 0, 1)
        kept = kept + share**2 * (3 - 2 * share) * details
    return kept


def without_crossings(moved: Mesh, before: Mesh) -> Mesh:
    """Move vertices back to where they were around faces that pass through others, until none does."""
    back = np.zeros(len(moved.faces), np.bool_)
    while len(pairs := moved.self_intersections()):
        back[pairs] = True
        back = moved.with_neighbours(back)
        vertices = moved.vertices.copy()
        at = moved.faces[back]
        vertices[at] = before.vertices[at]
        if np.array_equal(vertices, moved.vertices):  # it did so before
            break
        moved = Mesh(vertices, moved.faces)
    return moved
