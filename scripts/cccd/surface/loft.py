"""Ordered curves -> levels -> tubes -> tensor-product B-spline patches, eq. (10) -> closed mesh."""

from __future__ import annotations

import numpy as np

from cccd.containers import Curves
from cccd.settings import LoftSettings
from cccd.surface.fields import through_pixel_centres
from cccd.surface.matching import match_contours
from cccd.surface.patches import fit_patches
from cccd.surface.solid import join_patches
from cccd.surface.stack import CONTROL_BYTES, SliceStack, interpolate_slices
from cccd.surface.surface import Surface

__all__ = ["loft_surface"]

#: The tolerance does not grow with voxels larger than this in mm.
COARSEST_MM = 1.5
#: Pixels and slices above these sizes in mm (2 x 2 x 3 and some rounding) make a coarse scan.
COARSE_MM = (2.05, 3.05)
#: Six times volume by surface, the diameter of a ball, below this many voxels: a thin organ.
THIN_VOXELS = 15


def loft_surface(curves: Curves, settings: LoftSettings, pixel_centres: bool | None = None) -> Surface:
    """Loft a stack of ordered curves.

    Parameters
    ----------
    curves : Curves
        Closed simple curves, outlines and holes.
    settings : LoftSettings
        Section ``surface`` of the configuration.
    pixel_centres : bool, optional
        Whether the curves run through pixel centres (the surface then encloses the pixels, half a
        pixel further out) or are the outline itself; by default determined by their coordinates.

    Raises
    ------
    InputError
        When there is no curve at all, or none goes around the centre of a pixel.
    """
    if pixel_centres is None:
        pixel_centres = through_pixel_centres(curves)
    stack = interpolate_slices(curves, settings, pixel_centres)
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
    coarse = stack.step > COARSE_MM[1] or stack.voxel[1:].max() > COARSE_MM[0]
    thin = coarse or stack.voxels_through < THIN_VOXELS
    compactness = settings.compactness_thin if thin else settings.compactness
    return stack.marching_cubes_bytes / CONTROL_BYTES / compactness
