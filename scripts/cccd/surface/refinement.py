"""How many control points every tube gets: as few as a tolerance allows, and no more than a budget."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cccd.geometry.bsplines import DEGREE
from cccd.settings.surface import FittingSettings, LoftSettings
from cccd.surface.fitting import Fit, fit_samples
from cccd.surface.samples import Samples, lengths
from cccd.surface.stack import CONTROL_BYTES, SliceStack

__all__ = ["control_point_budget", "fit_within_budget", "fitting_tolerance"]

#: Fewest control points around and along a tube.
FEWEST = (6, 4)

Size = tuple[int, int]


def fitting_tolerance(stack: SliceStack, settings: LoftSettings) -> float:
    """Mean distance in mm between sections and surface that is good enough."""
    voxel = min(stack.pixel, float(np.cbrt(stack.voxel.prod())), settings.detail.coarsest_mm)
    share = np.interp(stack.filled, (0.0, 1.0), (settings.tolerance_voxels, settings.tolerance_filled))
    return float(share) * voxel


def control_point_budget(stack: SliceStack, settings: LoftSettings) -> float:
    """Control points that all patches together may have, by the size of marching cubes' mesh.

    It is that of slices interpolated to cubic voxels, as today's programs mesh them: what lies between thick
    slices has to be described, too.

    Between the compactness of thin or coarse stacks and that of all others runs a ramp of their logarithms;
    so it does between that of stacks that the learned filling interpolates and that of others.
    """
    rule = settings.detail
    edge = max(float(stack.voxel[1:].max()), rule.slice_share * stack.step)
    fine = float(np.interp(edge, rule.coarse_mm, (1.0, 0.0)))
    thick = float(np.interp(stack.voxels_through, rule.thin_voxels, (0.0, 1.0)))
    least = np.interp(
        stack.filled, (0.0, 1.0), np.log([settings.compactness_thin, settings.compactness_filled])
    )
    ends = least, np.log(settings.compactness)
    compactness = float(np.exp(np.interp(min(fine, thick), (0.0, 1.0), ends)))
    return stack.cubic_marching_cubes_bytes / CONTROL_BYTES / compactness


def fit_within_budget(
    samples: Sequence[Samples], tolerance: float, budget: float, settings: FittingSettings
) -> list[Fit]:
    """Refine every tube until its mean error is below the tolerance or the budget is used up.

    The next control points always go where they remove most error, weighted by the tube's size.

    Parameters
    ----------
    samples : sequence of Samples
        Of all tubes.
    tolerance : float
        Mean distance in mm that is good enough.
    budget : float
        Control points of all tubes together, at most (but for `FEWEST` per tube).
    settings : FittingSettings
        How nets grow, and what each fit smooths.
    """
    sizes = _refined_sizes(samples, tolerance, budget, settings)
    return [
        fit_samples(sample, size, settings.smoothing_pixels, settings.corrections)
        for sample, size in zip(samples, sizes, strict=True)
    ]


@dataclass(frozen=True, eq=False)
class _Trial:
    """A larger control net for a tube, its fit, and what error (mm^3) every added point removes."""

    size: Size
    fit: Fit
    gain: float


def _refined_sizes(
    samples: Sequence[Samples], tolerance: float, budget: float, settings: FittingSettings
) -> list[Size]:
    """Sizes of the control nets, by trial fits with one round of corrections."""
    whole = sum(sample.surface_area for sample in samples)
    first = settings.first_share * budget
    sizes = [_even_size(sample, first * sample.surface_area / whole) for sample in samples]
    fits = [_trial_fit(sample, size, settings) for sample, size in zip(samples, sizes, strict=True)]
    spent = sum(fit.count for fit in fits)
    unfinished = [n for n, fit in enumerate(fits) if fit.error > tolerance]
    trials: dict[int, _Trial] = {}
    while True:
        for n in unfinished:
            if n not in trials and (
                trial := _best_trial(samples[n], sizes[n], fits[n], budget - spent, settings)
            ):
                trials[n] = trial
        unfinished = [n for n in unfinished if n in trials]
        if not unfinished:
            return sizes
        n = max(unfinished, key=lambda tube: trials[tube].gain)
        trial = trials.pop(n)
        added = trial.fit.count - fits[n].count
        if spent + added > budget:  # another tube used the room that this was tried for
            continue
        spent += added
        sizes[n], fits[n] = trial.size, trial.fit
        if trial.fit.error <= tolerance:
            unfinished.remove(n)


def _trial_fit(samples: Samples, size: Size, settings: FittingSettings) -> Fit:
    return fit_samples(samples, size, settings.smoothing_pixels, 1)


def _best_trial(
    samples: Samples, size: Size, fit: Fit, room: float, settings: FittingSettings
) -> _Trial | None:
    """Fit the next larger control nets and pick the one whose added points remove most error each."""
    trials: list[_Trial] = []
    for larger in _larger_sizes(size, samples, room, settings.growth):
        trial = _trial_fit(samples, larger, settings)
        gain = (fit.error - trial.error) * samples.surface_area / (trial.count - fit.count)
        trials.append(_Trial(larger, trial, gain))
    return max(trials, key=lambda trial: trial.gain, default=None)


def _even_size(samples: Samples, count: float) -> Size:
    """Size of a control net of about ``count`` points with equal spacing in both directions."""
    around = float(np.mean(lengths(samples.outlines)))
    spacing = np.sqrt(around * samples.v[-1] / max(count, 1.0))
    sizes = np.array([around / spacing, samples.v[-1] / spacing + DEGREE])
    nu, nv = np.clip(np.rint(sizes), FEWEST, _largest_size(samples))
    return int(nu), int(nv)


def _largest_size(samples: Samples) -> Size:
    """Size of the largest control net that the samples determine."""
    return samples.around // 2, len(samples.z) + DEGREE


def _larger_sizes(size: Size, samples: Samples, room: float, growth: float) -> list[Size]:
    """List the next larger control nets, around or along, of at most ``room`` more points."""
    nu, nv = size
    most = _largest_size(samples)
    around = min(int(np.ceil(nu * growth)), most[0], nu + int(room / nv))
    along = min(int(np.ceil(nv * growth)), most[1], nv + int(room / nu))
    return [trial for trial in ((max(nu, around), nv), (nu, max(nv, along))) if trial != size]
