"""The grid's ripples taken off a mesh, and nothing of its shape."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cccd.geometry.mesh import Mesh
from cccd.settings.surface import BlendingSettings

__all__ = ["fair", "without_crossings"]

#: Averaging with the neighbours once spreads a vertex's value over this many edges (standard deviation).
EDGES_PER_AVERAGING = 0.5


def fair(
    mesh: Mesh,
    planes: Sequence[float],
    cell: float,
    edge_pixels: float,
    regain_pixels: float,
    settings: BlendingSettings,
) -> Mesh:
    """Smooth a closed mesh, but for its planar caps and their rims.

    A windowed sinc filter of the positions (Taubin et al. 1996) takes ripples off, and draws branches and
    tips in as well. What it took along the normals is alike all around a branch, and turns about within a
    ripple: averaged over some pixels along the surface, it is given back.

    Parameters
    ----------
    mesh : Mesh
        Isosurface of a grid, mm.
    planes : sequence of float
        Heights of the planar caps in mm.
    cell : float
        The grid's, mm.
    edge_pixels : float
        Length of the mesh's edges in pixels.
    regain_pixels : float
        Standard deviation of the average that is given back, in pixels.
    settings : BlendingSettings
        Of these ``cap_cells``, ``regain_rounds`` and what begins with ``fairing``.

    Returns
    -------
    Mesh
        The same faces.
    """
    smooth = mesh.low_passed(settings.fairing_band * edge_pixels, settings.fairing_rounds)
    averagings = int(np.ceil((regain_pixels / (EDGES_PER_AVERAGING * edge_pixels)) ** 2))
    for _ in range(settings.regain_rounds):
        normals = smooth.vertex_normals
        lost = np.einsum("vc,vc->v", mesh.vertices - smooth.vertices, normals)
        regained = mesh.averaged(lost, averagings)[:, None] * normals
        smooth = Mesh(smooth.vertices + regained, mesh.faces)
    away = np.abs(mesh.vertices[:, 2:] - np.array(planes)).min(axis=1, initial=np.inf) / cell
    share = np.clip(away / settings.cap_cells, 0, 1)[:, None]
    return Mesh(mesh.vertices + share * (smooth.vertices - mesh.vertices), mesh.faces)


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
