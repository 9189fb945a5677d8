"""Borders of slices -> distances on and between them -> zero level -> low pass -> spline -> checks."""

from __future__ import annotations

from cccd.bands import Band, Calibration, Reader, estimate_band
from cccd.bands.signs import Slices
from cccd.containers import Sections
from cccd.geometry.arrays import FloatArray
from cccd.geometry.mesh import Mesh
from cccd.settings.surface import LoftSettings
from cccd.surface.doubt import find_doubt
from cccd.surface.spline import SplineSolid, loft_spline
from cccd.surface.stack import interpolate_slices
from cccd.surface.surface import LoftedSurface

__all__ = ["band_of", "loft_in_plane", "loft_surface"]


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
    solid, frame = loft_in_plane(sections, settings), sections.curves.frame
    surface = solid.to_world(frame)
    doubt = find_doubt(solid.mesh, sections.probability, frame, solid.stack.origin, settings.band)
    surface.band = band_of(solid.mesh, solid.stack.slices, settings, doubt)
    surface.report["warnings"] += surface.band.warnings(solid.stack.slices.ratio)
    return surface


def loft_in_plane(sections: Sections, settings: LoftSettings) -> SplineSolid:
    """Loft as `loft_surface` does, in the plane's mm and height."""
    return loft_spline(interpolate_slices(sections, settings), settings.smoothing)


def band_of(mesh: Mesh, slices: Slices, settings: LoftSettings, doubt: FloatArray | None = None) -> Band:
    """Estimate a surface's error band as the settings say: see `cccd.bands.estimate_band`."""
    reader = None if settings.reader_mm is None else Reader.of(settings.reader_mm)
    return estimate_band(mesh, slices, settings.band, Calibration.read(settings.calibration), reader, doubt)
