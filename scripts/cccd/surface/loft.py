"""Borders of slices -> distances on and between them -> zero level -> low pass -> spline -> checks."""

from __future__ import annotations

from cccd.bands import Calibration, estimate_band
from cccd.containers import Frame, Sections
from cccd.settings.surface import LoftSettings
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
        Section ``surface`` of the configuration.

    Raises
    ------
    InputError
        When there is no curve at all, or none goes around the centre of a pixel.
    """
    return _with_band(loft_in_plane(sections, settings), sections.curves.frame, settings)


def loft_in_plane(sections: Sections, settings: LoftSettings) -> SplineSolid:
    """Loft as `loft_surface` does, in the plane's mm and height."""
    return loft_spline(interpolate_slices(sections, settings), settings.smoothing)


def _with_band(solid: SplineSolid, frame: Frame, settings: LoftSettings) -> LoftedSurface:
    """Give a solid in mm RAS, with its error band."""
    calibration = Calibration.read(settings.calibration)
    surface = solid.to_world(frame)
    surface.band = estimate_band(solid.mesh, solid.stack.slices, settings.band, calibration)
    surface.report["warnings"] += surface.band.warnings(solid.stack.slices.ratio)
    return surface
