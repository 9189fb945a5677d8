"""The distances that our surface is made of, as an isosurface: what filter and spline add, and lose."""

from __future__ import annotations

from cccd.containers import Structure
from cccd.geometry.mesh import Mesh
from cccd.settings.surface import LoftSettings
from cccd.surface.stack import interpolate_slices
from cccd.tracing import trace_mask

__all__ = ["lofted_distances"]


def lofted_distances(structure: Structure) -> Mesh:
    """Mesh the zero level of the signed distances between a mask's slices, by flying edges.

    They are those of `cccd.surface.stack`, by its default settings.

    Parameters
    ----------
    structure : Structure
        With a mask.

    Returns
    -------
    Mesh
        In world mm (RAS), outwards.
    """
    stack = interpolate_slices(structure.sections(trace_mask(structure)), LoftSettings())
    return stack.distance.zero_surface().transformed(stack.plane_to_world(structure.frame)).outwards()
