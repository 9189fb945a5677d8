"""Ordered curves -> levels -> tubes -> tensor-product B-spline patches, eq. (10) -> closed mesh."""

from __future__ import annotations

import numpy as np

from cccd.containers import Curves, Splines
from cccd.errors import InputError
from cccd.settings.surface import LoftSettings
from cccd.surface.matching import match_contours
from cccd.surface.outlines import lofted_outlines
from cccd.surface.patches import fit_patches
from cccd.surface.solid import join_patches
from cccd.surface.stack import CONTROL_BYTES, SliceStack, interpolate_slices
from cccd.surface.surface import Surface

__all__ = ["loft_surface"]

#: The tolerance does not grow with voxels larger than this in mm.
COARSEST_MM = 1.5


def loft_surface(curves: Curves, settings: LoftSettings, splines: Splines | None = None) -> Surface:
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

    Raises
    ------
    InputError
        When there is no curve at all, or none goes around the centre of a pixel.
    """
    if len(curves) == 0:
        raise InputError("curves", "there is not one closed curve", "check the mask or the boundary maps")
    stack = interpolate_slices(lofted_outlines(curves, splines, settings), settings)
    tubes = match_contours(stack, settings.matching)
    reach = max(settings.blending.reach_pixels * stack.pixel, settings.blending.reach_steps * stack.step)
    tolerance, budget = _tolerance(stack, settings), _budget(stack, settings)
    patches = fit_patches(tubes, stack, reach, tolerance, budget, settings.fitting)
    solid = join_patches(patches, stack, reach, settings.edge_voxels * stack.pixel, settings.blending)
    return solid.to_world(curves.frame)


def _tolerance(stack: SliceStack, settings: LoftSettings) -> float:
    """Mean distance in mm between curves and surface that is good enough."""
    return settings.tolerance_voxels * min(stack.pixel, float(np.cbrt(stack.voxel.prod())), COARSEST_MM)


def _budget(stack: SliceStack, settings: LoftSettings) -> float:
    """Control points that all patches together may have, by the size of marching cubes' mesh."""
    rule = settings.detail
    edge = max(float(stack.voxel[1:].max()), rule.slice_share * stack.step)
    fine = float(np.interp(edge, rule.coarse_mm, (1.0, 0.0)))
    thick = float(np.interp(stack.voxels_through, rule.thin_voxels, (0.0, 1.0)))
    ends = np.log([settings.compactness_thin, settings.compactness])
    compactness = float(np.exp(np.interp(min(fine, thick), (0.0, 1.0), ends)))
    return stack.marching_cubes_bytes / CONTROL_BYTES / compactness
