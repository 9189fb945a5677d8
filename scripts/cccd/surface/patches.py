"""From tubes to patches: every tube sampled, and fitted by a tensor-product B-spline, eq. (10)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cccd.geometry.arrays import FloatArray
from cccd.geometry.bsplines import DEGREE, Patch
from cccd.settings.surface import LoftSettings
from cccd.surface.blending import blend_reach
from cccd.surface.fitting import Fit
from cccd.surface.matching import Tubes
from cccd.surface.refinement import control_point_budget, fit_within_budget, fitting_tolerance
from cccd.surface.samples import sample_tube
from cccd.surface.stack import SliceStack
from cccd.surface.tubes import Tube

__all__ = ["FittedTubes", "fit_patches"]

#: Samples around a tube: a multiple of this, at least and at most.
SAMPLES_MULTIPLE, SAMPLES_RANGE = 16, (32, 320)


@dataclass(frozen=True, eq=False)
class FittedTubes:
    """Tubes and the control nets fitted to them.

    Attributes
    ----------
    tubes : Tubes
        What was fitted.
    fits : list of Fit
        One for each tube.
    jumps : (P, 3) float64
        mm; points along the lines where a tube jumps from one section to the next.
    """

    tubes: Tubes
    fits: list[Fit]
    jumps: FloatArray

    @property
    def control_points(self) -> int:
        """Number of control points of all tubes."""
        return sum(fit.count for fit in self.fits)

    def patches(self) -> list[Patch]:
        """Return the control nets as patches, in the plane's mm and height."""
        return [_patch(fit, tube.hole) for fit, tube in zip(self.fits, self.tubes.tubes, strict=True)]


def fit_patches(tubes: Tubes, stack: SliceStack, settings: LoftSettings) -> FittedTubes:
    """Fit a patch to every tube.

    Parameters
    ----------
    tubes : Tubes
        The tubes of ``stack``.
    stack : SliceStack
        Its target field says which part of a tube ends up below another's surface, its sizes how closely and
        with how many control points the tubes are fitted.
    settings : LoftSettings
    """
    pixel, hidden = stack.pixel, blend_reach(stack, settings.blending) / 2
    samples = [
        sample_tube(tube, _samples_around(tube, pixel), stack.target, pixel, hidden, settings.fitting)
        for tube in tubes.tubes
    ]
    jumps = np.concatenate([sample.jumps for sample in samples])
    tolerance, budget = fitting_tolerance(stack, settings), control_point_budget(stack, settings)
    return FittedTubes(tubes, fit_within_budget(samples, tolerance, budget, settings.fitting), jumps)


def _samples_around(tube: Tube, pixel: float) -> int:
    """Count the samples around a tube: about one per pixel of its longest section."""
    longest = max(
        np.hypot(*(np.roll(section.points, -1, axis=0) - section.points).T).sum() for section in tube.sections
    )
    return int(np.clip(SAMPLES_MULTIPLE * np.ceil(longest / pixel / SAMPLES_MULTIPLE), *SAMPLES_RANGE))


def _patch(fit: Fit, hole: bool) -> Patch:
    """Patch of a control net, whose rows are plane; weights are all one."""
    nu, nv = fit.net.shape[:2]
    points = np.dstack([fit.net, np.broadcast_to(fit.heights, (nu, nv))])
    return Patch(
        points, np.ones((nu, nv)), fit.knots_u, fit.knots_v, DEGREE, DEGREE, True, False, -1 if hole else 1
    )
