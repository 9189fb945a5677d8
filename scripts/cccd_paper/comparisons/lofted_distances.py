"""Our surface before its last steps: the distances as an isosurface, the filtered mesh without a spline."""

from __future__ import annotations

from cccd.containers import Sections, Structure
from cccd.contours import trace_contours
from cccd.geometry.mesh import Mesh
from cccd.settings.surface import LoftSettings
from cccd.surface.smooth_mesh import cut_at_ends, smooth_mesh
from cccd.surface.stack import interpolate_slices


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
    stack = interpolate_slices(structure.sections(trace_contours(structure)), LoftSettings())
    return stack.distance.zero_surface().transformed(stack.to_world).outwards()


def filtered_mesh(sections: Sections, settings: LoftSettings) -> Mesh:
    """Mesh slices as `cccd.surface.loft_surface` does, up to the spline.

    The spline lies within some hundredths of a pixel of this mesh and takes most of the time, so rivals of
    which only distances are shown do without it.

    Parameters
    ----------
    sections : Sections
        Curves, and what else is known of the slices.
    settings : LoftSettings
        Section ``surface`` of the configuration.

    Returns
    -------
    Mesh
        Closed, in world mm (RAS), outwards.
    """
    stack = interpolate_slices(sections, settings)
    mesh = cut_at_ends(smooth_mesh(stack, settings.smoothing), stack.distance)
    return mesh.transformed(stack.to_world).outwards()
