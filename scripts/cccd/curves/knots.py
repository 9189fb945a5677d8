"""Knots where the shape asks for them: insertion where a fit fails, removal where it costs least.

A least-squares spline from which one knot is taken changes by a known amount: the third derivative must
no longer jump there, one linear condition on five control points, so the refitted spline follows from
the old normal equations. That gives the price of every knot in one sweep. Cheap knots go, several at a
time where they are too far apart to matter to each other; the rest is refitted and checked.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy

from cccd.curves.periodic import (
    basis,
    least_squares,
    pieces,
    project,
    slope_at,
    tangent_least_squares,
    value_at,
)
from cccd.geometry._jit import jit, jit_dividing_by_zero, jit_within
from cccd.geometry.arrays import BoolArray, FloatArray, IntArray
from cccd.geometry.polygons import DEGREE, extend_knots
from cccd.tolerances import RIDGE, STILL, TINY

#: Control points a closed cubic spline needs.
FEWEST = 4

#: Control points to either side of a removed knot that its removal is taken to move. What a cubic spline
#: feels of a change falls to 27 % from one control point to the next: to 0.04 % over six ...
_REACH = 6

#: ... and to 1e-9 over the rows by which the closed band is unrolled at either end: its factor settles.
_RUN_IN = 16

#: Spans to either side over which the removal's effect on the distances is summed.
_NEAR = 4

#: How many times finer than its samples a curve is filtered.
_FINER = 3

#: Width of the filter that takes the pixels' steps away, which are a pixel high: a wider one would take the
#: organ's own shape.
STAIRCASE_PX = 1.5

#: Distance of the samples for a budget of control points: every pixel counts alike.
SPACING_PX = 1.0

# Distance of the samples where the filter has its full width: without the pixels' steps they may lie further
# apart.
_SMOOTH_SPACING_PX = 2.0

# Samples per width of a narrower filter: what it leaves is no finer.
_SAMPLES_PER_WIDTH = 1.5

#: Samples of a curve at least: six for each control point of the smallest spline.
FEWEST_SAMPLES = 24

# Even knots to begin with, as a share of the samples: enough that few spans must be halved, few enough to be
# quick. For a budget they are all the choice there is: the cheapest go until it is met.
_FIRST_SHARE = 0.16
_FIRST_SHARE_BUDGET = 0.3

# Share of the knots that may go at once within a tolerance, as their prices hold while their neighbours stay;
# and while every trial is fitted closely, as the last knots are worth more care.
_REMOVAL_SHARE = 0.25
_CLOSE_REMOVAL_SHARE = 0.1

# Rounds of distance minimisation in a close fit: the first bring nearly all.
_CLOSE_ROUNDS = 2

# For a budget: share of the excess knots that go at once, as no tolerance can be missed on the way; fits are
# close from so many times the wanted knots on, as earlier ones are thrown away; rounds of the last fit, which
# ends earlier when one brings nothing.
_BUDGET_REMOVAL_SHARE = 0.35
_CLOSE_MULTIPLE = 1.3
_LAST_ROUNDS = 6

# Reweighting by the distance (Lawson), to bring the largest down: rounds, of which the first bring nearly
# all; tried where the largest is at most so many tolerances, as it brings none further down; and the least
# and largest weight, as no point may rule alone.
_LEVELLING_ROUNDS = 3
_LEVELLING_REACH = 1.4
_LEVELLING_WEIGHTS = (0.05, 20.0)

# Reweighting by the inverse distance for a budget, to bring the sum down, which is the area between and what
# Dice counts: rounds, and the least distance taken, or points on the curve would rule.
_FLATTENING_ROUNDS = 5
_FLAT_PX = 0.08

# Share of the tolerance that is kept at the samples: between them a little more may be needed.
_SAMPLE_SHARE = 0.97
#: Samples of a curve to be fitted lie at least this far apart.
_LEAST_SPACING_PX = 0.1
#: Spans between a curve's knots that are shorter than this are not halved.
_LEAST_SPAN_PX = 0.05


class _Fit(NamedTuple):
    """A closed spline through ``points`` (m, 2) and how it was found."""

    breaks: np.ndarray  # (n,)
    knots: np.ndarray  # (n + 7,)
    control: np.ndarray  # (n, 2)
    parameters: np.ndarray  # (m,) of the points' foot points
    distance: np.ndarray  # (m,) from the points to the curve


class _Task(NamedTuple):
    """What is to be fitted, and how."""

    points: np.ndarray  # (m, 2)
    period: float  # length of the closed polygon through them
    sliding: float  # weight of the tangential distance


def _third_derivatives(knots: np.ndarray, count: int) -> np.ndarray:
    """Third derivative on each span as a combination (n, 4) of its control points."""
    third = np.empty((count, 4))
    _write_third(knots, np.zeros((3, 4)), np.empty((2, 4)), third)
    return third


@jit_dividing_by_zero  # where knots coincide
def _write_third(knots: FloatArray, first: FloatArray, second: FloatArray, third: FloatArray) -> None:
    for s in range(len(third)):
        for r in range(3):
            width = knots[s + r + 4] - knots[s + r + 1]
            first[r, r], first[r, r + 1] = -3.0 / width, 3.0 / width
        for r in range(2):
            width = knots[s + r + 4] - knots[s + r + 2]
            for q in range(4):
                second[r, q] = 2.0 * (first[r + 1, q] - first[r, q]) / width
        width = knots[s + 4] - knots[s + 3]
        for q in range(4):
            third[s, q] = (second[1, q] - second[0, q]) / width


def _removal_costs(fit: _Fit, points: np.ndarray, kept: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Predict what the removal of each knot would do to the distances.

    Returns
    -------
    cost : (n,) float array
        Growth of the sum of squared distances; inf for knots that must stay.
    peak : (n,) float array
        Largest distance near the knot afterwards.
    """
    count, total = len(fit.control), len(points)
    span, value = basis(fit.knots, fit.parameters)
    into = fit.parameters - fit.knots[span + 3]
    normal, distance = np.empty((total, 2)), np.empty(total)
    cyclic = np.zeros((count, 4))  # cyclic[a, d] = N[a, a - d]
    _measure(pieces(fit.knots, fit.control), points, into, span, value, normal, distance, cyclic)
    factor = np.zeros((count + 2 * _RUN_IN, 4))
    _unrolled_factor(cyclic, RIDGE * total / count, factor)
    begin = np.searchsorted(span, np.arange(count + 1))  # first point of each span
    cost, peak = np.full(count, np.inf), np.full(count, np.inf)
    third, change = _third_derivatives(fit.knots, count), np.empty(2 * _REACH + 5)
    _remove_each(fit.control, kept, factor, third, begin, value, normal, distance, change, cost, peak)
    return cost, peak


@jit
def _measure(
    curve: FloatArray,
    points: FloatArray,
    into: FloatArray,
    span: IntArray,
    value: FloatArray,
    normal: FloatArray,
    distance: FloatArray,
    cyclic: FloatArray,
) -> None:
    """Write normals and signed distances at the points, and the normal equations of least squares."""
    for m in range(len(points)):
        s, piece, h = span[m], curve[span[m]], into[m]
        slope_x, slope_y = slope_at(piece, h, 0), slope_at(piece, h, 1)
        speed = max(np.sqrt(slope_x * slope_x + slope_y * slope_y), STILL)
        normal[m, 0], normal[m, 1] = -slope_y / speed, slope_x / speed
        distance[m] = (points[m, 0] - value_at(piece, h, 0)) * normal[m, 0]
        distance[m] += (points[m, 1] - value_at(piece, h, 1)) * normal[m, 1]
        for p in range(4):
            for q in range(p + 1):
                cyclic[(s + p) % len(curve), p - q] += value[m, p] * value[m, q]


@jit_dividing_by_zero  # knots that coincide cost inf, and stay
def _remove_each(
    control: FloatArray,
    kept: BoolArray,
    factor: FloatArray,
    third: FloatArray,
    begin: IntArray,
    value: FloatArray,
    normal: FloatArray,
    distance: FloatArray,
    change: FloatArray,
    cost: FloatArray,
    peak: FloatArray,
) -> None:
    """Write cost and peak of each knot's removal; ``change`` is room for what the control points do."""
    count, size = len(control), len(change)
    for k in range(1, count):
        if kept[k]:
            continue
        low = k - 1 + _RUN_IN - _REACH
        for n in range(size):
            total_n = _jump(third, k, n - _REACH)
            for d in range(1, min(n, 3) + 1):
                total_n -= factor[low + n, d] * change[n - d]
            change[n] = total_n / factor[low + n, 0]
        for n in range(size - 1, -1, -1):
            total_n = change[n]
            for d in range(1, min(size - 1 - n, 3) + 1):
                total_n -= factor[low + n + d, d] * change[n + d]
            change[n] = total_n / factor[low + n, 0]
        jump_x, jump_y, norm = 0.0, 0.0, 0.0
        for q in range(5):
            jump = _jump(third, k, q)
            jump_x += jump * control[(k - 1 + q) % count, 0]
            jump_y += jump * control[(k - 1 + q) % count, 1]
            norm += jump * change[_REACH + q]
        jump_x, jump_y = jump_x / norm, jump_y / norm
        cost[k], peak[k] = 0.0, 0.0
        for shift in range(-_NEAR - 3, min(_NEAR + 3, count - _NEAR - 3)):
            s = (k + shift) % count
            for m in range(begin[s], begin[s + 1]):
                moved = 0.0
                for q in range(4):
                    n = shift + q + 1 + _REACH
                    if 0 <= n < size:
                        moved += value[m, q] * change[n]
                new = distance[m] + moved * (jump_x * normal[m, 0] + jump_y * normal[m, 1])
                new, old = new * new, distance[m] * distance[m]
                cost[k] += new - old
                peak[k] = max(peak[k], new)
        peak[k] = np.sqrt(peak[k])


@jit_within
def _jump(third: FloatArray, k: int, q: int) -> float:
    """How the third derivative's jump at a knot depends on control point ``k - 1 + q``."""
    after = third[k, q - 1] if 1 <= q < 5 else 0.0
    before = third[k - 1, q] if 0 <= q < 4 else 0.0
    return after - before


@jit
def _unrolled_factor(cyclic: FloatArray, ridge: float, factor: FloatArray) -> None:
    """Write the Cholesky factor of the closed band, unrolled by a run-in at either end."""
    count = len(cyclic)
    bending = (6.0 * ridge, -4.0 * ridge, ridge, 0.0)
    for a in range(len(factor)):
        for d in range(min(a, 3), -1, -1):
            total = cyclic[(a - _RUN_IN) % count, d] + bending[d]
            for e in range(d + 1, min(a, 3) + 1):
                total -= factor[a, e] * factor[a - d, e - d]
            if d == 0:
                factor[a, 0] = np.sqrt(max(total, TINY))
            else:
                factor[a, d] = total / factor[a - d, 0]


def _fit(task: _Task, breaks: np.ndarray, parameters: np.ndarray, rounds: int) -> _Fit:
    """Least squares at the given parameters, then ``rounds`` of distance minimisation along normals."""
    knots, parameters = extend_knots(breaks, task.period), parameters.copy()
    control = least_squares(knots, len(breaks), task.points, parameters)
    distance = project(knots, control, task.points, parameters, 2)
    fit = _Fit(breaks, knots, control, parameters, distance)
    alike = np.ones(len(task.points))
    for _ in range(rounds):
        closer = _reweighted(task, fit, alike)
        if not closer.distance @ closer.distance < fit.distance @ fit.distance:
            break
        fit = closer
    return fit


def _reweighted(task: _Task, fit: _Fit, weights: np.ndarray) -> _Fit:
    """One round of distance minimisation with weighted points."""
    parameters = fit.parameters.copy()
    control = tangent_least_squares(fit.knots, fit.control, task.points, weights, parameters, task.sliding)
    distance = project(fit.knots, control, task.points, parameters, 3)
    return _Fit(fit.breaks, fit.knots, control, parameters, distance)


def _insert(task: _Task, fit: _Fit, kept: np.ndarray, tolerance: float) -> tuple[np.ndarray, np.ndarray]:
    """Halve every span that holds a point farther away than the tolerance and at least three points.

    Spans near zero stay: points that crowd there are a fit's failure, which more knots would not fix.
    """
    count = len(fit.breaks)
    span = np.searchsorted(fit.breaks, fit.parameters, side="right") - 1
    far = np.bincount(span, fit.distance > tolerance, count) > 0
    ends = np.append(fit.breaks, fit.breaks[0] + task.period)
    several = (np.bincount(span, minlength=count) >= 3) & (np.diff(ends) > _LEAST_SPAN_PX)
    split = np.flatnonzero(far & several)
    middle = (ends[split] + ends[split + 1]) / 2
    return np.insert(fit.breaks, split + 1, middle), np.insert(kept, split + 1, False)


@jit
def _choose(
    cost: FloatArray, order: IntArray, peak: FloatArray, most: int, limit: float, gone: BoolArray
) -> None:
    """Mark the cheapest knots, at most ``most``, four apart, none with a peak above the limit, as ``gone``.

    ``order`` (n,) sorts the costs; a sort within would take three times as long to compile.
    """
    count = len(cost)
    taken = 0
    for k in order:
        if taken >= most or not np.isfinite(cost[k]):
            break
        free = peak[k] <= limit
        for shift in range(-3, 4):
            free = free and not gone[(k + shift) % count]
        if free:
            gone[k] = True
            taken += 1


def _cheapest(task: _Task, fit: _Fit, kept: np.ndarray, most: int, limit: float) -> np.ndarray:
    """Knots (n,) bool whose removal costs least: at most ``most``, none that would leave the limit."""
    cost, peak = _removal_costs(fit, task.points, kept)
    gone = np.zeros(len(cost), np.bool_)
    _choose(cost, np.argsort(cost), peak, most, limit, gone)
    return gone


def _fit_within_tolerance(task: _Task, fit: _Fit, kept: np.ndarray, tolerance: float) -> _Fit:
    """Fewest knots whose spline keeps the tolerance: inserted where it does not, removed while it does."""
    fit, kept = _enriched(task, fit, kept, tolerance)
    for rounds, share in ((0, _REMOVAL_SHARE), (_CLOSE_ROUNDS, _CLOSE_REMOVAL_SHARE)):
        most = len(fit.breaks)
        while len(fit.breaks) > FEWEST:
            most = min(most, max(1, int(share * len(fit.breaks))), len(fit.breaks) - FEWEST)
            gone = _cheapest(task, fit, kept, most, tolerance)
            if not gone.any():
                break
            trial = _fit(task, fit.breaks[~gone], fit.parameters, rounds)
            if not trial.distance.max() <= tolerance:  # nan too
                if most == 1:
                    break
                most = max(1, most // 3)
                continue
            fit, kept = trial, kept[~gone]
    return _one_by_one(task, fit, kept, tolerance)


def _enriched(task: _Task, fit: _Fit, kept: np.ndarray, tolerance: float) -> tuple[_Fit, np.ndarray]:
    """Insert knots until the fit keeps the tolerance, or more would not help."""
    while fit.distance.max() > tolerance:
        breaks, more_kept = _insert(task, fit, kept, tolerance)
        if len(breaks) == len(fit.breaks) or len(breaks) > 2 * len(task.points):
            break  # more knots than the points can hold tell nothing more
        richer = _fit(task, breaks, fit.parameters, 0)
        if not np.isfinite(richer.distance).all():
            break
        fit, kept = richer, more_kept
    return fit, kept


def _one_by_one(task: _Task, fit: _Fit, kept: np.ndarray, tolerance: float) -> _Fit:
    """Remove the cheapest knots one by one, each fit as close and as level as can be."""
    current = fit
    while len(current.breaks) > FEWEST:
        gone = _cheapest(task, current, kept, 1, np.inf)
        if not gone.any():
            break
        kept = kept[~gone]
        current = _fit(task, current.breaks[~gone], current.parameters, _CLOSE_ROUNDS)
        level = _levelled(task, current, tolerance)
        if level.distance.max() > tolerance:
            break
        fit = level
    return fit


def _levelled(task: _Task, fit: _Fit, tolerance: float) -> _Fit:
    """Bring the largest distance down by Lawson's reweighting where that may make it keep the tolerance."""
    if not tolerance < fit.distance.max() <= _LEVELLING_REACH * tolerance:
        return fit
    weights, current = np.ones(len(task.points)), fit
    for _ in range(_LEVELLING_ROUNDS):
        weights = np.clip(weights * current.distance / current.distance.mean(), *_LEVELLING_WEIGHTS)
        current = _reweighted(task, current, weights)
        if current.distance.max() < fit.distance.max():
            fit = current
    return fit


def _flattened(task: _Task, fit: _Fit) -> _Fit:
    """Bring the sum of distances down, which is the area between points and curve: what Dice counts."""
    current = fit
    for _ in range(_FLATTENING_ROUNDS):
        weights = 1 / np.maximum(current.distance, _FLAT_PX)
        current = _reweighted(task, current, weights / weights.mean())
        if not current.distance.sum() < fit.distance.sum():
            break
        fit = current
    return fit


def _fit_with_knots(task: _Task, fit: _Fit, kept: np.ndarray, target: int) -> _Fit:
    """Best spline with ``target`` knots: the cheapest go until so many are left."""
    while len(fit.breaks) > target:
        excess = len(fit.breaks) - target
        gone = _cheapest(task, fit, kept, max(1, int(_BUDGET_REMOVAL_SHARE * excess)), np.inf)
        if not gone.any():
            break
        kept = kept[~gone]
        near = np.count_nonzero(~gone) <= _CLOSE_MULTIPLE * target
        fit = _fit(task, fit.breaks[~gone], fit.parameters, int(near))
    return _fit(task, fit.breaks, fit.parameters, _LAST_ROUNDS)


def reference(
    polygon: np.ndarray, corners: np.ndarray, spacing: float, sigma: float, fewest: int
) -> tuple[np.ndarray, np.ndarray]:
    """Sample a closed polygon, its staircase smoothed away, and mark its corners.

    Parameters
    ----------
    polygon : (n, 2) float array
    corners : (n,) bool array
    spacing : float
        Distance of the samples in pixels, about.
    sigma : float
        Standard deviation in pixels of the filter ``2 g - g * g`` with a Gaussian g: it keeps area and
        curvature where a plain Gaussian would shrink them. Towards a corner it fades out.
    fewest : int
        Samples at least.

    Returns
    -------
    samples : (m, 2) float array
        The first is the polygon's first corner, or its first point.
    corner : (m,) bool array
    """
    anchors = np.flatnonzero(corners)
    if len(anchors):
        polygon = np.roll(polygon, -anchors[0], axis=0)
        anchors = anchors - anchors[0]
    else:
        anchors = np.zeros(1, np.int64)
    link = np.linalg.norm(np.roll(polygon, -1, axis=0) - polygon, axis=1)
    position = np.concatenate([[0.0], np.cumsum(link)])
    at = np.append(position[anchors], position[-1])
    pieces = np.maximum(np.ceil(np.diff(at) / spacing), max(2, fewest // len(anchors))).astype(int)
    spans = zip(at[:-1].tolist(), at[1:].tolist(), pieces.tolist(), strict=True)
    parts: list[FloatArray] = [np.linspace(a, b, int(_FINER * n), endpoint=False) for a, b, n in spans]
    fine = np.concatenate(parts)
    ring = np.vstack([polygon, polygon[:1]])
    line = np.column_stack([np.interp(fine, position, ring[:, axis]) for axis in (0, 1)])
    samples = line[::_FINER]
    corner = np.zeros(len(samples), bool)
    if corners.any():
        corner[np.cumsum(pieces) - pieces] = True
    step = sigma * _FINER / spacing
    reach = min(int(6 * step), len(line) // 2 - 1)
    if reach < 1:
        return samples, corner
    tap = np.arange(-reach, reach + 1)
    narrow, wide = np.exp(-0.5 * (tap / step) ** 2), np.exp(-0.25 * (tap / step) ** 2)
    kernel = 2 * narrow / narrow.sum() - wide / wide.sum()
    smooth = scipy.ndimage.convolve1d(line, kernel, axis=0, mode="wrap")[::_FINER]
    if corner.any():
        away = np.abs(fine[::_FINER, None] - at[None, :]).min(axis=1)
        smooth = samples + np.minimum(away / (4 * sigma), 1)[:, None] * (smooth - samples)
    return smooth, corner


def _first_breaks(
    parameters: np.ndarray, period: float, corner: np.ndarray, number: int
) -> tuple[np.ndarray, np.ndarray]:
    """Even breaks, of which those at corners are threefold; they and the first one stay."""
    anchors = np.flatnonzero(corner)
    begin = parameters[anchors] if len(anchors) else np.zeros(1)
    end = np.append(begin[1:], period)
    times = DEGREE if len(anchors) else 1
    breaks: list[list[float] | FloatArray] = []
    kept: list[list[bool]] = []
    for a, b in zip(begin.tolist(), end.tolist(), strict=True):
        pieces = max(int(np.rint(number * (b - a) / period)), 1)
        breaks += [[a] * times, np.linspace(a, b, pieces, endpoint=False)[1:]]
        kept += [[True] * times, [False] * (pieces - 1)]
    return np.concatenate(breaks), np.concatenate(kept).astype(bool)


def fit_closed_spline(
    polygon: np.ndarray, corners: np.ndarray, tolerance: float, sigma: float, target: int, sliding: float
) -> tuple[np.ndarray, np.ndarray, float]:
    """Fit a closed cubic spline to a closed polygon.

    Parameters
    ----------
    polygon : (n, 2) float array
    corners : (n,) bool array
        Sharp corners: a triple knot each, never removed.
    tolerance : float
        Largest distance in pixels from the reference to the curve.
    sigma : float
        Width in pixels of the filter that makes the reference from the polygon.
    target : int
        Control points wanted; 0 leaves the number to the tolerance.
    sliding : float
        Weight of the tangential distance in the closer fits: near 0 the fit is closest, at 1 it is plain
        least squares, which folds less easily.

    Returns
    -------
    control points (n, 2), knots (n + 7,), largest distance in pixels from the reference to the curve
    """
    if target:
        spacing = SPACING_PX
    elif sigma >= STAIRCASE_PX:
        spacing = _SMOOTH_SPACING_PX
    else:
        spacing = max(sigma / _SAMPLES_PER_WIDTH, _LEAST_SPACING_PX)
    points, corner = reference(polygon, corners, spacing, sigma, FEWEST_SAMPLES)
    points = np.ascontiguousarray(points)  # compiled code is compiled once for one layout
    link = np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1)
    parameters, period = np.cumsum(link) - link, float(link.sum())
    task = _Task(points, period, sliding)
    share = _FIRST_SHARE_BUDGET if target else _FIRST_SHARE
    number = max(int(share * len(points)), target, FEWEST)
    breaks, kept = _first_breaks(parameters, period, corner, number)
    fit = _fit(task, breaks, parameters, 0)
    if target:
        fit = _flattened(task, _fit_with_knots(task, fit, kept, max(target, FEWEST)))
    else:
        fit = _fit_within_tolerance(task, fit, kept, _SAMPLE_SHARE * tolerance)
    return fit.control, fit.knots, float(fit.distance.max())
