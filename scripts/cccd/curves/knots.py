"""Knots where the shape asks for them: insertion where a fit fails, removal where it costs least.

A least-squares spline from which one knot is taken changes by a known amount: the third derivative must
no longer jump there, one linear condition on five control points, so the refitted spline follows from
the old normal equations. That gives the price of every knot in one sweep. Cheap knots go, several at a
time where they are too far apart to matter to each other; the rest is refitted and checked.
"""

from __future__ import annotations

import numba
import numpy as np

from cccd.curves.periodic import (
    DEGREE,
    basis,
    derivatives,
    extend_knots,
    least_squares,
    project,
    span_of,
)

__all__ = ["fit_ragged"]

#: Control points a closed cubic spline needs.
FEWEST = 4

#: Control points to either side of a removed knot that its removal is taken to move.
_REACH = 8

#: Spans to either side over which the removal's effect on the distances is summed.
_NEAR = 5

#: Rows by which the closed band is unrolled at either end, so that its factor settles.
_RUN_IN = 16

#: Share of the removable knots that may go in one round.
_SHARE = 0.35


@numba.njit(cache=True)
def _third_derivative(knots, s, row):
    """Third derivative on a span as a combination (4,) of its control points."""
    first = np.zeros((3, 4))
    second = np.zeros((2, 4))
    for r in range(3):
        width = knots[s + r + 4] - knots[s + r + 1]
        first[r, r], first[r, r + 1] = -3.0 / width, 3.0 / width
    for r in range(2):
        width = knots[s + r + 4] - knots[s + r + 2]
        for q in range(4):
            second[r, q] = 2.0 * (first[r + 1, q] - first[r, q]) / width
    width = knots[s + 4] - knots[s + 3]
    for q in range(4):
        row[q] = (second[1, q] - second[0, q]) / width


@numba.njit(cache=True)
def _removal_costs(knots, control, points, parameters, kept):
    """Predict what the removal of each knot would do to the distances.

    Returns
    -------
    cost : (n,) float array
        Growth of the sum of fourth powers of the distances (inf for knots that must stay): large
        distances weigh more than in a sum of squares, small ones still count.
    peak : (n,) float array
        Largest distance near the knot afterwards.
    """
    count, total = len(control), len(points)
    value = np.empty((total, 4))
    normal = np.empty((total, 2))
    distance = np.empty(total)
    begin = np.full(count + 1, total, np.int64)  # first point of each span
    cyclic = np.zeros((count, 4))  # cyclic[a, d] = N[a, a - d]
    local = np.empty((3, 2))
    s = 0
    for m in range(total):
        s = span_of(knots, count, parameters[m], s)
        if begin[s] == total:
            begin[s] = m
        basis(knots, s, parameters[m], value[m])
        derivatives(knots, control, s, parameters[m], local)
        speed = max(np.sqrt(local[1, 0] ** 2 + local[1, 1] ** 2), 1e-12)
        normal[m, 0], normal[m, 1] = -local[1, 1] / speed, local[1, 0] / speed
        distance[m] = (points[m, 0] - local[0, 0]) * normal[m, 0]
        distance[m] += (points[m, 1] - local[0, 1]) * normal[m, 1]
        for p in range(4):
            for q in range(p + 1):
                cyclic[(s + p) % count, p - q] += value[m, p] * value[m, q]
    for s in range(count - 1, -1, -1):
        if begin[s] == total:
            begin[s] = begin[s + 1]
    factor = _unrolled_factor(cyclic, 1e-7 * total / count)

    cost = np.full(count, np.inf)
    peak = np.full(count, np.inf)
    before, after = np.empty(4), np.empty(4)
    jump = np.empty(5)
    size = 2 * _REACH + 5
    change = np.empty(size)
    for k in range(1, count):
        if kept[k]:
            continue
        _third_derivative(knots, k - 1, before)
        _third_derivative(knots, k, after)
        for q in range(5):  # the condition acts on the control points k - 1 .. k + 3
            jump[q] = (after[q - 1] if q > 0 else 0.0) - (before[q] if q < 4 else 0.0)
        low = k - 1 + _RUN_IN - _REACH
        for n in range(size):
            total_n = jump[n - _REACH] if 0 <= n - _REACH < 5 else 0.0
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
            jump_x += jump[q] * control[(k - 1 + q) % count, 0]
            jump_y += jump[q] * control[(k - 1 + q) % count, 1]
            norm += jump[q] * change[_REACH + q]
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
                cost[k] += new * new - old * old
                peak[k] = max(peak[k], new)
        peak[k] = np.sqrt(peak[k])
    return cost, peak


@numba.njit(cache=True)
def _unrolled_factor(cyclic, ridge):
    """Cholesky factor of the closed band, unrolled by a run-in at either end."""
    count = len(cyclic)
    size = count + 2 * _RUN_IN
    factor = np.zeros((size, 4))
    bending = (6.0 * ridge, -4.0 * ridge, ridge, 0.0)
    for a in range(size):
        for d in range(min(a, 3), -1, -1):
            total = cyclic[(a - _RUN_IN) % count, d] + bending[d]
            for e in range(d + 1, min(a, 3) + 1):
                total -= factor[a, e] * factor[a - d, e - d]
            if d == 0:
                factor[a, 0] = np.sqrt(max(total, 1e-300))
            else:
                factor[a, d] = total / factor[a - d, 0]
    return factor


@numba.njit(cache=True)
def _fit(breaks, period, points, parameters, rounds):
    """Least squares and parameter correction by turns; parameters change in place."""
    knots = extend_knots(breaks, period)
    weights = np.ones(len(points))
    control = least_squares(knots, len(breaks), points, weights, parameters)
    distance = project(knots, control, points, parameters, 2)
    for _ in range(rounds - 1):
        control = least_squares(knots, len(breaks), points, weights, parameters)
        distance = project(knots, control, points, parameters, 2)
    return knots, control, distance


@numba.njit(cache=True)
def _insert(breaks, kept, period, parameters, distance, tolerance):
    """Halve every span that holds a point farther away than the tolerance and at least three points."""
    count = len(breaks)
    held = np.zeros(count, np.int64)
    bad = np.zeros(count, np.bool_)
    s = 0
    for m in range(len(parameters)):
        while s < count - 1 and parameters[m] >= breaks[s + 1]:
            s += 1
        held[s] += 1
        bad[s] |= distance[m] > tolerance
    more = 0
    for s in range(count):
        bad[s] &= held[s] >= 3
        more += bad[s]
    new_breaks = np.empty(count + more)
    new_kept = np.zeros(count + more, np.bool_)
    n = 0
    for s in range(count):
        new_breaks[n], new_kept[n] = breaks[s], kept[s]
        n += 1
        if bad[s]:
            stop = breaks[s + 1] if s < count - 1 else breaks[0] + period
            new_breaks[n] = (breaks[s] + stop) / 2
            n += 1
    return new_breaks, new_kept


@numba.njit(cache=True)
def _choose(cost, peak, most, limit):
    """Cheapest knots to remove, at most ``most``, four apart, none whose peak exceeds the limit."""
    count = len(cost)
    gone = np.zeros(count, np.bool_)
    taken = 0
    for k in np.argsort(cost):
        if taken >= most or not np.isfinite(cost[k]):
            break
        free = peak[k] <= limit
        for shift in range(-3, 4):
            free &= not gone[(k + shift) % count]
        if free:
            gone[k] = True
            taken += 1
    return gone, taken


@numba.njit(cache=True)
def _spline(points, parameters, period, breaks, kept, tolerance, target):
    """Fewest knots within the tolerance, or the given number of them when it is positive.

    Returns
    -------
    knots, control points
    """
    by_count = target > 0
    knots, control, distance = _fit(breaks, period, points, parameters, 2)
    while not by_count and distance.max() > tolerance:
        more, more_kept = _insert(breaks, kept, period, parameters, distance, tolerance)
        if len(more) == len(breaks):
            break
        breaks, kept = more, more_kept
        knots, control, distance = _fit(breaks, period, points, parameters, 2)
    goal = max(target, FEWEST)
    limit = np.inf if by_count else 1.1 * tolerance  # the correction of parameters brings a little back
    most = len(breaks)
    while len(breaks) > goal:
        count = len(breaks)
        cost, peak = _removal_costs(knots, control, points, parameters, kept)
        allowed = int(_SHARE * (count - goal)) if by_count else int(_SHARE * count / 2)
        gone, taken = _choose(cost, peak, max(1, min(most, allowed)), limit)
        if taken == 0:
            break
        trial = parameters.copy()
        fewer = breaks[~gone]
        result = _fit(fewer, period, points, trial, 1)
        if not by_count:
            tries = 0
            while result[2].max() > tolerance and tries < 2:
                result = _fit(fewer, period, points, trial, 1)
                tries += 1
            if result[2].max() > tolerance:
                if taken == 1:
                    kept = kept | gone
                most = max(1, taken // 3)
                continue
        breaks, kept, parameters = fewer, kept[~gone], trial
        knots, control, distance = result
    if by_count:
        knots, control, distance = _fit(breaks, period, points, parameters, 4)
    return knots, control


@numba.njit(cache=True)
def _reference(points, corners, spacing, sigma):
    """Sample a closed polygon, its staircase smoothed away, and mark its corners.

    The polygon is sampled evenly between corners (the first of which is the first sample) and filtered
    along its length by ``2 g - g * g`` with a Gaussian g: that keeps area and curvature where a plain
    Gaussian would shrink them. Towards a corner the filter fades out.

    Returns
    -------
    samples : (m, 2) float array
    corner : (m,) bool array
    """
    count = len(points)
    anchors = np.flatnonzero(corners)
    if len(anchors) == 0:
        anchors = np.zeros(1, np.int64)
    fine_x, fine_y = [0.0][:0], [0.0][:0]
    fine_corner = [False][:0]
    for a in range(len(anchors)):
        begin = anchors[a]
        links = (anchors[(a + 1) % len(anchors)] - begin - 1) % count + 1
        length = 0.0
        for n in range(links):
            p, q = points[(begin + n) % count], points[(begin + n + 1) % count]
            length += np.sqrt((q[0] - p[0]) ** 2 + (q[1] - p[1]) ** 2)
        pieces = 2 * max(int(np.ceil(length / spacing)), 12 // len(anchors), 2)
        n, walked, link = 0, 0.0, 0.0
        p, q = points[begin], points[(begin + 1) % count]
        link = np.sqrt((q[0] - p[0]) ** 2 + (q[1] - p[1]) ** 2)
        for piece in range(pieces):
            wanted = piece * length / pieces
            while wanted > walked + link and n < links - 1:
                walked += link
                n += 1
                p, q = points[(begin + n) % count], points[(begin + n + 1) % count]
                link = np.sqrt((q[0] - p[0]) ** 2 + (q[1] - p[1]) ** 2)
            share = (wanted - walked) / link if link > 0.0 else 0.0
            fine_x.append(p[0] + share * (q[0] - p[0]))
            fine_y.append(p[1] + share * (q[1] - p[1]))
            fine_corner.append(piece == 0 and corners[begin])
    x, y, corner = np.array(fine_x), np.array(fine_y), np.array(fine_corner)
    size = len(x)
    step = sigma / (spacing / 2)  # standard deviation in samples
    taps = min(int(4 * 1.5 * step), size // 2 - 1)
    samples = np.empty((size // 2, 2))
    for m in range(size // 2):
        samples[m, 0], samples[m, 1] = x[2 * m], y[2 * m]
    if taps < 1:
        return samples, corner[::2]
    narrow = np.exp(-0.5 * (np.arange(taps + 1) / step) ** 2)
    wide = np.exp(-0.25 * (np.arange(taps + 1) / step) ** 2)
    narrow /= 2 * narrow.sum() - 1
    wide /= 2 * wide.sum() - 1
    kernel = 2 * narrow - wide
    from_corner = np.full(size, np.inf)
    for a in np.flatnonzero(corner):
        for shift in range(-2 * taps, 2 * taps + 1):
            m = (a + shift) % size
            from_corner[m] = min(from_corner[m], abs(shift))
    for m in range(size // 2):
        at = 2 * m
        smooth_x, smooth_y = kernel[0] * x[at], kernel[0] * y[at]
        for tap in range(1, taps + 1):
            ahead, behind = (at + tap) % size, (at - tap) % size
            smooth_x += kernel[tap] * (x[ahead] + x[behind])
            smooth_y += kernel[tap] * (y[ahead] + y[behind])
        share = min(1.0, from_corner[at] / (2.0 * taps))
        samples[m, 0] += share * (smooth_x - x[at])
        samples[m, 1] += share * (smooth_y - y[at])
    return samples, corner[::2]


@numba.njit(cache=True)
def fit_ragged(points, offsets, corners, tolerance, sigma, target):
    """Fit a closed cubic spline to each of many ragged closed polygons.

    Parameters
    ----------
    points : (P, 2) float array
    offsets : (C + 1,) int array
    corners : (P,) bool array
        Sharp corners: a triple knot each, never removed.
    tolerance : (C,) float array
        Largest distance from the reference to the curve, in pixels.
    sigma : (C,) float array
        Standard deviation in pixels of the filter that makes the reference from the polygon.
    target : (C,) int array
        Control points wanted; 0 leaves the number to the tolerance.

    Returns
    -------
    control : (N, 2) float array
    control_offsets : (C + 1,) int64 array
    knots : (M,) float array
    """
    curves = len(offsets) - 1
    control_offsets = np.zeros(curves + 1, np.int64)
    room = 4 * len(points) + 64 * curves
    control = np.empty((room, 2))
    knots = np.empty(room + 7 * curves)
    for c in range(curves):
        outline = points[offsets[c] : offsets[c + 1]]
        sharp = corners[offsets[c] : offsets[c + 1]]
        spacing = 1.0 if target[c] > 0 else min(max(sigma[c], 0.75), 1.5)
        samples, corner = _reference(outline, sharp, spacing, sigma[c])
        count = len(samples)
        parameters = np.zeros(count)
        for m in range(1, count):
            gap = samples[m] - samples[m - 1]
            parameters[m] = parameters[m - 1] + np.sqrt(gap[0] ** 2 + gap[1] ** 2)
        gap = samples[0] - samples[count - 1]
        period = parameters[count - 1] + np.sqrt(gap[0] ** 2 + gap[1] ** 2)
        number = int(0.16 * count) if target[c] == 0 else max(int(0.3 * count), target[c])
        breaks, kept = _first_breaks(parameters, period, corner, max(number, FEWEST))
        found = _spline(samples, parameters, period, breaks, kept, tolerance[c], target[c])
        n = len(found[1])
        control_offsets[c + 1] = control_offsets[c] + n
        control[control_offsets[c] : control_offsets[c + 1]] = found[1]
        at = control_offsets[c] + 7 * c
        knots[at : at + n + 7] = found[0]
    end = control_offsets[curves]
    return control[:end], control_offsets, knots[: end + 7 * curves]


@numba.njit(cache=True)
def _first_breaks(parameters, period, corner, number):
    """Even breaks, of which those at corners are threefold and stay."""
    anchors = np.flatnonzero(corner)
    plain = len(anchors) == 0
    if plain:
        anchors = np.zeros(1, np.int64)
    breaks, kept = [0.0][:0], [True][:0]
    for a in range(len(anchors)):
        begin = parameters[anchors[a]]
        end = parameters[anchors[a + 1]] if a + 1 < len(anchors) else period
        for _ in range(1 if plain else DEGREE):
            breaks.append(begin)
            kept.append(True)
        pieces = max(int(np.rint(number * (end - begin) / period)), 1)
        for piece in range(1, pieces):
            breaks.append(begin + piece * (end - begin) / pieces)
            kept.append(False)
    return np.array(breaks), np.array(kept)
