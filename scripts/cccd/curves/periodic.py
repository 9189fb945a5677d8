"""Closed cubic B-splines: evaluation, least squares by a wrapped design matrix, foot points.

A closed spline with n control points has n spans. Span ``s`` lies between the knots ``t[s + 3]`` and
``t[s + 4]`` and is ruled by the control points ``s .. s + 3`` (mod n), so that the last three columns of
the design matrix of the unwrapped spline fall onto the first three. That keeps the normal equations
banded but for their last three rows, which a Schur complement takes care of: the cost is linear in n.

Everything here is compiled; the loops are over points and cost nanoseconds.
"""

from __future__ import annotations

import numba
import numpy as np

__all__ = [
    "DEGREE",
    "basis",
    "derivatives",
    "evaluate",
    "extend_knots",
    "least_squares",
    "project",
    "sample_ragged",
    "span_of",
]

#: Cubic throughout (equations 6-9).
DEGREE = 3

#: Weight of the control polygon's bending against the data's; it only decides what the data leave open.
_RIDGE = 1e-7


@numba.njit(cache=True)
def extend_knots(breaks, period):
    """Knots (n + 7,) of a closed cubic spline from its n breaks, ascending in ``[0, period)``."""
    count = len(breaks)
    knots = np.empty(count + 2 * DEGREE + 1)
    for m in range(len(knots)):
        turn, index = divmod(m - DEGREE, count)
        knots[m] = breaks[index] + turn * period
    return knots


@numba.njit(cache=True)
def span_of(knots, count, u, guess):
    """Span of ``u``, sought from a guess onwards (parameters ascend, so it is near)."""
    s = guess
    if u < knots[s + 3]:
        s = 0
    while s < count - 1 and u >= knots[s + 4]:
        s += 1
    return s


@numba.njit(cache=True)
def basis(knots, s, u, value):
    """Cubic basis functions of a span by the recurrence of eq. (8)."""
    value[0] = 1.0
    for degree in range(1, 4):
        saved = 0.0
        for r in range(degree):
            right = knots[s + 4 + r] - u
            left = u - knots[s + 4 + r - degree]
            width = right + left
            share = value[r] / width if width > 0.0 else 0.0
            value[r] = saved + right * share
            saved = left * share
        value[degree] = saved


@numba.njit(cache=True)
def derivatives(knots, control, s, u, out):
    """Write position, first and second derivative (3, 2) at ``u`` of span ``s`` into ``out``."""
    count = len(control)
    x = np.empty((4, 2))
    for r in range(4):
        for axis in range(2):
            x[r, axis] = control[(s + r) % count, axis]
    first = np.zeros((3, 2))
    second = np.zeros((2, 2))
    for r in range(3):
        width = knots[s + r + 4] - knots[s + r + 1]
        if width > 0.0:
            for axis in range(2):
                first[r, axis] = 3.0 * (x[r + 1, axis] - x[r, axis]) / width
    for r in range(2):
        width = knots[s + r + 4] - knots[s + r + 2]
        if width > 0.0:
            for axis in range(2):
                second[r, axis] = 2.0 * (first[r + 1, axis] - first[r, axis]) / width
    for axis in range(2):  # de Boor's algorithm on each derivative
        for level in range(1, 4):
            for r in range(3, level - 1, -1):
                low, high = knots[s + r], knots[s + r + 4 - level]
                share = (u - low) / (high - low) if high > low else 0.0
                x[r, axis] += (share - 1.0) * (x[r, axis] - x[r - 1, axis])
        for level in range(1, 3):
            for r in range(2, level - 1, -1):
                low, high = knots[s + r + 1], knots[s + r + 4 - level]
                share = (u - low) / (high - low) if high > low else 0.0
                first[r, axis] += (share - 1.0) * (first[r, axis] - first[r - 1, axis])
        low, high = knots[s + 3], knots[s + 4]
        share = (u - low) / (high - low) if high > low else 0.0
        second[1, axis] += (share - 1.0) * (second[1, axis] - second[0, axis])
        out[0, axis] = x[3, axis]
        out[1, axis] = first[2, axis]
        out[2, axis] = second[1, axis]


@numba.njit(cache=True)
def evaluate(knots, control, parameters):
    """Position, first and second derivative (m, 3, 2) at ascending parameters of the base period."""
    out = np.empty((len(parameters), 3, 2))
    s = 0
    for m in range(len(parameters)):
        s = span_of(knots, len(control), parameters[m], s)
        derivatives(knots, control, s, parameters[m], out[m])
    return out


@numba.njit(cache=True)
def least_squares(knots, count, points, weights, parameters):
    """Control points (n, 2) that minimise the weighted squared distance to ``points`` (m, 2).

    Parameters
    ----------
    knots : (n + 7,) float array
    count : int
        n, at least 4.
    points : (m, 2) float array
    weights : (m,) float array
    parameters : (m,) float array
        Ascending within one period.
    """
    body = count - DEGREE  # unknowns in the band; the other three close the curve
    band = np.zeros((body, 4))  # band[a, d] = N[a, a - d]
    border = np.zeros((3, count))  # last three rows of N
    right = np.zeros((count, 2))
    value = np.empty(4)
    s, total = 0, 0.0
    for m in range(len(points)):
        s = span_of(knots, count, parameters[m], s)
        basis(knots, s, parameters[m], value)
        weight = weights[m]
        total += weight
        for p in range(4):
            a = s + p
            a -= count if a >= count else 0
            scaled = weight * value[p]
            right[a, 0] += scaled * points[m, 0]
            right[a, 1] += scaled * points[m, 1]
            for q in range(4):
                b = s + q
                b -= count if b >= count else 0
                if a >= body:
                    border[a - body, b] += scaled * value[q]
                elif b <= a:
                    band[a, a - b] += scaled * value[q]
    bending = _RIDGE * total / count
    for middle in range(count):
        for p in range(3):
            a = (middle + p - 1) % count
            for q in range(3):
                b = (middle + q - 1) % count
                term = bending * (-2.0 if p == 1 else 1.0) * (-2.0 if q == 1 else 1.0)
                if a >= body:
                    border[a - body, b] += term
                elif b <= a:
                    band[a, a - b] += term
    return _solve(band, border, right)


@numba.njit(cache=True)
def _solve(band, border, right):
    """Solve the symmetric system of a band and a border of three rows (Cholesky, Schur complement)."""
    body, count = len(band), len(right)
    for a in range(body):
        for d in range(min(a, 3), -1, -1):
            b = a - d
            total = band[a, d]
            for e in range(d + 1, min(a, 3) + 1):
                if e - d <= 3:
                    total -= band[a, e] * band[b, e - d]
            if d == 0:
                band[a, 0] = np.sqrt(max(total, 1e-300))
            else:
                band[a, d] = total / band[b, 0]
    # columns: the two coordinates, then the three border columns
    columns = np.empty((count, 5))
    for a in range(body):
        columns[a, 0], columns[a, 1] = right[a, 0], right[a, 1]
        for r in range(3):
            columns[a, 2 + r] = border[r, a]
    for a in range(body):
        for c in range(5):
            total = columns[a, c]
            for d in range(1, min(a, 3) + 1):
                total -= band[a, d] * columns[a - d, c]
            columns[a, c] = total / band[a, 0]
    schur = np.empty((3, 3))
    rest = np.empty((3, 2))
    for r in range(3):
        for c in range(3):
            total = border[r, body + c]
            for a in range(body):
                total -= columns[a, 2 + r] * columns[a, 2 + c]
            schur[r, c] = total
        for c in range(2):
            total = right[body + r, c]
            for a in range(body):
                total -= columns[a, 2 + r] * columns[a, c]
            rest[r, c] = total
    closing = np.linalg.solve(schur, rest)
    control = np.empty((count, 2))
    control[body:] = closing
    for a in range(body - 1, -1, -1):
        for c in range(2):
            total = columns[a, c]
            for r in range(3):
                total -= columns[a, 2 + r] * closing[r, c]
            for d in range(1, min(body - 1 - a, 3) + 1):
                total -= band[a + d, d] * control[a + d, c]
            control[a, c] = total / band[a, 0]
    return control


@numba.njit(cache=True)
def project(knots, control, points, parameters, steps):
    """Move each parameter towards the foot point of its point: Newton steps, order kept.

    Parameters
    ----------
    knots, control : arrays
        The closed spline.
    points : (m, 2) float array
    parameters : (m,) float array
        Ascending; changed in place.
    steps : int
        Newton steps; the distance at the start of the last one is given back.

    Returns
    -------
    (m,) float array
        Distances from the points to the curve at the parameters before the last step; each is an upper
        bound of the true distance.
    """
    count = len(control)
    begin, end = knots[3], knots[count + 3]
    distance = np.empty(len(points))
    local = np.empty((3, 2))
    for step in range(steps):
        s = 0
        before = begin
        for m in range(len(points)):
            u = parameters[m]
            s = span_of(knots, count, u, s)
            derivatives(knots, control, s, u, local)
            dx, dy = points[m, 0] - local[0, 0], points[m, 1] - local[0, 1]
            distance[m] = np.sqrt(dx * dx + dy * dy)
            if step == steps - 1:
                continue
            along = dx * local[1, 0] + dy * local[1, 1]
            speed = local[1, 0] ** 2 + local[1, 1] ** 2
            slope = speed - dx * local[2, 0] - dy * local[2, 1]
            slope = max(slope, 0.5 * speed)  # far from the foot point Newton may turn round
            move = along / slope if slope > 0.0 else 0.0
            reach = knots[s + 4] - knots[s + 3]
            u += min(max(move, -reach), reach)
            u = min(max(u, before), np.nextafter(end, begin))
            parameters[m] = u
            before = u
    return distance


@numba.njit(cache=True)
def sample_ragged(control, offsets, knots, counts):
    """Points (Q, 2) of ragged closed splines at ``counts[c]`` parameters each, evenly over the period.

    ``knots`` holds n + 7 knots per curve, one curve after the other.
    """
    out = np.empty((counts.sum(), 2))
    local = np.empty((3, 2))
    at = 0
    for c in range(len(counts)):
        begin, end = offsets[c], offsets[c + 1]
        own = knots[begin + 7 * c : end + 7 * (c + 1)]
        points = control[begin:end]
        count = end - begin
        low, high = own[3], own[count + 3]
        s = 0
        for m in range(counts[c]):
            u = low + (high - low) * m / counts[c]
            s = span_of(own, count, u, s)
            derivatives(own, points, s, u, local)
            out[at, 0], out[at, 1] = local[0, 0], local[0, 1]
            at += 1
    return out
