"""Hollow bodies: a wall of one thickness, inwards or outwards from a surface."""

from __future__ import annotations

import numpy as np

from cccd.errors import InputError
from cccd.geometry.mesh import Mesh
from cccd_meshes.distance_grid import grid_to_mesh

#: Grid steps per thickness: the surface at a distance is within 1 % of the thickness where it is that round.
_STEPS = 4

#: Nodes of the grid at most: 4 bytes each.
_MOST_NODES = 120e6


def moved_surface(mesh: Mesh, distance: float, location: str) -> Mesh:
    """Make the surface at a distance from a closed mesh: outside it, or inside where that is negative.

    Parameters
    ----------
    mesh : Mesh
    distance : float
        In the mesh's unit; not 0.
    location : str
        What messages name.

    Raises
    ------
    InputError
        Nothing inside is so far from the mesh, or the grid would be too large.

    Examples
    --------
    >>> import trimesh
    >>> ball = trimesh.creation.icosphere(4, 10.0)
    >>> moved = moved_surface(Mesh(ball.vertices, ball.faces), -2.0, "ball")
    >>> bool(abs(moved.volume / (4 / 3 * np.pi * 8**3) - 1) < 0.02), moved.is_closed_manifold
    (True, True)
    """
    step = abs(distance) / _STEPS
    margin = (max(distance, 0.0) + 2 * step) * np.ones(3)
    low = mesh.vertices.min(axis=0) - margin
    a, b, c = (int(n) + 1 for n in np.ceil((mesh.vertices.max(axis=0) + margin - low) / step))
    if float(a) * b * c > _MOST_NODES:
        raise InputError(
            location,
            f"a wall of {abs(distance):g} mm needs a grid of {a} x {b} x {c}",
            "choose a thicker wall, or crop to the vessel",
        )
    grid = grid_to_mesh(mesh, low, step, (a, b, c), _STEPS + 2.0)
    try:
        return grid.isosurface(distance)
    except ValueError:
        raise InputError(
            location,
            f"no place inside is {abs(distance):g} mm from its surface: no cavity is left",
            "choose a thinner wall, or --outwards",
        ) from None


def hollow_wall(mesh: Mesh, thickness: float, outwards: bool, location: str) -> tuple[Mesh, Mesh]:
    """Make a wall of one thickness: its outer surface, and its inner one turned inside out.

    Parameters
    ----------
    mesh : Mesh
        Closed, in mm: the outer surface, or the inner one with ``outwards``.
    thickness : float
        In mm.
    outwards : bool
    location : str
        What messages name.

    Returns
    -------
    outer, inner : Mesh
        Together they bound the wall.

    Raises
    ------
    InputError
        The thickness is not positive, or leaves no cavity.
    """
    if not thickness > 0:
        raise InputError("--thickness", f"{thickness:g} is no thickness", "give mm, more than 0")
    if outwards:
        return moved_surface(mesh, thickness, location), mesh.reversed()
    return mesh, moved_surface(mesh, -thickness, location).reversed()
