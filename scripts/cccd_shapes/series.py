"""A series of one organ: control points that are splines in time, fitted to all frames at once."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import BSpline

from cccd.errors import InputError
from cccd.geometry.arrays import FloatArray
from cccd.geometry.subdivision import ControlMesh
from cccd_shapes.cohort import Cohort, problem_of
from cccd_shapes.fit import Fit, Goal, fit_points, surface_rms
from cccd_shapes.template import Template

#: Degree in time; frames for each coefficient; fewest frames; condition number above which there are fewer
#: coefficients, as frames leave gaps.
DEGREE, FRAMES, FEWEST_FRAMES, DETERMINED = 3, 2, 6, 30.0
#: Times at which volumes are written; draws and percentiles of their interval; deviations in a band's 90 %.
TIMES, DRAWS, PERCENTILES, BAND = 41, 4000, (5, 95), 2 * 1.645


@dataclass(frozen=True, eq=False)
class Series:
    """An organ over time."""

    spline: ControlMesh  # mean over time, mm
    coefficients: FloatArray  # (K, V, 3) of the control points
    # (K + 4,) of cubic B-splines; (K + 7,) where periodic: the first three coefficients follow the last
    knots: FloatArray
    period: float | None
    # (T, 4) time, volume and its 90 % interval in ml, evenly spaced over the frames or over the period
    volumes: FloatArray
    ejection: FloatArray  # (3,) 1 - least by largest volume, and its 90 % interval

    def at(self, time: float) -> ControlMesh:
        """Return the organ's spline at a time."""
        weight = _weights(np.array([time]), self.knots, self.period)[0]
        return self.spline.moved(np.asarray(np.tensordot(weight, self.coefficients, 1), float))


def time_basis(times: FloatArray, period: float | None, where: str = "time") -> tuple[FloatArray, FloatArray]:
    """Return knots, and how much each coefficient counts (F, K) at each of the frames' times (F,).

    Examples
    --------
    >>> knots, basis = time_basis(np.linspace(0, 0.9, 10), 1.0)
    >>> basis.shape, basis.sum(axis=1).round(9).tolist() == [1.0] * 10
    ((10, 5), True)
    """
    if len(times) < FEWEST_FRAMES:
        raise InputError(where, f"{len(times)} frames are too few", f"give {FEWEST_FRAMES} that fit")
    least = DEGREE + 1
    for count in range(max(len(times) // FRAMES, least), least - 1, -1):
        if period:
            knots = period * np.arange(-DEGREE, count + DEGREE + 1) / count
        else:
            inner = np.quantile(times, np.linspace(0, 1, count - DEGREE + 1))
            knots = np.concatenate([[inner[0]] * DEGREE, inner, [inner[-1]] * DEGREE])
        basis = _weights(times, knots, period)
        if np.linalg.cond(basis) < DETERMINED:
            return knots, basis
    raise InputError(where, "the frames leave parts of the time open", "give more, or another --period")


def _weights(times: FloatArray, knots: FloatArray, period: float | None) -> FloatArray:
    """How much each coefficient counts (F, K) at times (F,)."""
    at = np.mod(times, period) if period else times
    found = np.asarray(BSpline.design_matrix(at, knots, DEGREE).toarray(), float)
    if period:
        found[:, :DEGREE] += found[:, -DEGREE:]
        found = found[:, :-DEGREE]
    return found


def fit_series(cohort: Cohort, period: float | None, seed: int = 0) -> tuple[Cohort, Series]:
    """Fit one spline in space and time to all frames that fit by themselves.

    Parameters
    ----------
    cohort : Cohort
        Its subjects are frames, with times.
    period : float or None
        Time after which the organ is as it was, in the sheet's unit; None: it does not repeat.
    seed : int
        Of the draws that intervals come from.

    Returns
    -------
    Cohort
        With the series' surfaces in place of the frames' own.
    Series

    Raises
    ------
    InputError
        Fewer than six frames fit, or three the series; or they leave parts of the time open.
    """
    used = cohort.used
    subjects = [cohort.subjects[n] for n in used]
    times = np.array([subject.row.time for subject in subjects], float)
    knots, basis = time_basis(times, period)
    solved = np.linalg.lstsq(basis, cohort.shapes.reshape(len(used), -1))[0]
    start = np.asarray(solved.reshape(basis.shape[1], -1, 3), float)
    spline = cohort.template.spline.moved(start.mean(axis=0))
    goals = [Goal(subject.mesh) for subject in subjects]
    made = fit_points(Template(spline), start, goals, basis)
    fits, problems = list(cohort.fits), list(cohort.problems)
    for n, shape in zip(used, np.tensordot(basis, made, 1), strict=True):
        moved, subject = spline.moved(shape), cohort.subjects[n]
        mesh = moved.tessellate()
        fits[n] = Fit(moved, surface_rms(mesh, subject.mesh), len(mesh.self_intersections()))
        problems[n] = problem_of(fits[n], subject.tolerance)
    ends = (0.0, period) if period else (times.min(), times.max())
    at = _weights(even := np.linspace(*ends, TIMES), knots, period)
    volumes = _volumes(spline, at, made)
    off = np.array([subject.mesh.volume for subject in subjects]) / 1000 - _volumes(spline, basis, made)
    widths = [np.ptp(one.band.volume_interval(one.mesh)) if one.band else 0.0 for one in subjects]
    drawn = volumes + _errors(basis, at, off, np.array(widths) / BAND, seed)
    least, most = volumes.argmin(), volumes.argmax()
    share = 1 - drawn[:, least] / drawn[:, most]
    ejection = np.array([1 - volumes[least] / volumes[most], *np.percentile(share, PERCENTILES)])
    table = np.column_stack([even, volumes, *np.percentile(drawn, PERCENTILES, axis=0)])
    series = Series(spline, made, knots, period, table, ejection)
    return replace(cohort, fits=fits, problems=problems).checked(), series


def _volumes(spline: ControlMesh, weights: FloatArray, coefficients: FloatArray) -> FloatArray:
    """Volumes (T,) in ml at times by their weights (T, K)."""
    shapes = np.tensordot(weights, coefficients, 1)
    return np.array([spline.moved(shape).tessellate().volume for shape in shapes]) / 1000


def _errors(basis: FloatArray, at: FloatArray, off: FloatArray, widths: FloatArray, seed: int) -> FloatArray:
    """Draw errors (D, T) in ml: each frame's own, as large as frames are off, and one of all bands (mm^3)."""
    draw = np.random.default_rng(seed)
    free = max(len(off) - basis.shape[1], 1)
    spread = np.sqrt(np.sum(off**2) / draw.chisquare(free, DRAWS))
    smooth = at @ np.linalg.pinv(basis)
    alone = draw.normal(size=(DRAWS, len(off))) * spread[:, None]
    return alone @ smooth.T + draw.normal(size=(DRAWS, 1)) * (smooth @ widths) / 1000
