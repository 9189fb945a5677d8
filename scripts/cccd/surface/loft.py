"""Ordered curves -> distances on and between slices -> control mesh -> fit -> checks."""

from __future__ import annotations

from cccd.bands import Calibration, estimate_band
from cccd.containers import Annotation, Curves, ProbabilityStack, Splines
from cccd.errors import InputError
from cccd.settings.surface import LoftSettings
from cccd.surface.outlines import lofted_outlines
from cccd.surface.spline import SplineSolid, loft_spline
from cccd.surface.stack import interpolate_slices
from cccd.surface.surface import Surface

__all__ = ["loft_in_plane", "loft_surface"]


def loft_surface(
    curves: Curves,
    settings: LoftSettings,
    splines: Splines | None = None,
    probability: ProbabilityStack | None = None,
    annotation: Annotation | None = None,
) -> Surface:
    """Loft a stack of ordered curves.

    Parameters
    ----------
    curves : Curves
        Closed simple curves, outlines and holes. Those through pixel centres stand for the pixels, whose
        border lies half a pixel further out; any others are the border itself.
    settings : LoftSettings
        Section ``surface`` of the configuration.
    splines : Splines, optional
        Closed splines of the curves, from which the surface is lofted where ``settings.source`` says so; by
        default they are fitted here, by the default settings of the curves.
    probability : ProbabilityStack, optional
        Probabilities of which the curves are the level; between slices that lie near enough to each other
        the surface follows them.
    annotation : Annotation, optional
        Where only some slices were drawn: the surface runs on between them however far apart they lie, and
        follows planes that were drawn across them.

    Raises
    ------
    InputError
        When there is no curve at all, or none goes around the centre of a pixel.
    """
    calibration = Calibration.read(settings.calibration)
    solid = loft_in_plane(curves, settings, splines, probability, annotation)
    surface = solid.to_world(curves.frame)
    surface.band = estimate_band(solid.mesh, solid.stack.slices, settings.band, calibration)
    surface.report["warnings"] += surface.band.warnings(solid.stack.slices.ratio)
    return surface


def loft_in_plane(
    curves: Curves,
    settings: LoftSettings,
    splines: Splines | None = None,
    probability: ProbabilityStack | None = None,
    annotation: Annotation | None = None,
) -> SplineSolid:
    """Loft as `loft_surface` does, in the plane's mm and height."""
    if len(curves) == 0:
        raise InputError("curves", "there is no closed curve", "check the mask or the boundary maps")
    outlines = lofted_outlines(curves, splines, settings)
    stack = interpolate_slices(outlines, settings, probability, annotation)
    return loft_spline(stack, settings.smallest_part_voxels)
