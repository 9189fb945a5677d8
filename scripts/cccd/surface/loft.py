"""Ordered curves -> distances on and between slices -> control mesh -> fit -> checks."""

from __future__ import annotations

from cccd.bands import Calibration, estimate_band
from cccd.containers import Sections
from cccd.errors import InputError
from cccd.settings.surface import LoftSettings
from cccd.surface.outlines import lofted_outlines
from cccd.surface.spline import SplineSolid, loft_spline
from cccd.surface.stack import interpolate_slices
from cccd.surface.surface import LoftedSurface

__all__ = ["loft_in_plane", "loft_surface"]


def loft_surface(sections: Sections, settings: LoftSettings) -> LoftedSurface:
    """Loft a stack of ordered curves.

    Parameters
    ----------
    sections : Sections
        The curves, and what else is known of the slices.
    settings : LoftSettings
        Section ``surface`` of the configuration; ``source`` says whether splines or curves are lofted.

    Raises
    ------
    InputError
        When there is no curve at all, or none goes around the centre of a pixel.
    """
    calibration = Calibration.read(settings.calibration)
    solid = loft_in_plane(sections, settings)
    surface = solid.to_world(sections.curves.frame)
    surface.band = estimate_band(solid.mesh, solid.stack.slices, settings.band, calibration)
    surface.report["warnings"] += surface.band.warnings(solid.stack.slices.ratio)
    return surface


def loft_in_plane(sections: Sections, settings: LoftSettings) -> SplineSolid:
    """Loft as `loft_surface` does, in the plane's mm and height."""
    if len(sections.curves) == 0:
        raise InputError("curves", "there is no closed curve", "check the mask or the boundary maps")
    outlines = lofted_outlines(sections, settings)
    stack = interpolate_slices(outlines, sections, settings)
    return loft_spline(stack, settings.smallest_part_voxels)
