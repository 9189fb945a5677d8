"""Closed cubic B-splines through points: least squares by a wrapped design matrix, foot points.

The control points of a closed spline wrap: the last three columns of the design matrix of the unwrapped
spline fall onto the first three. That keeps the normal equations banded but for their last three rows,
which a Schur complement takes care of: the cost is linear in n.

The loops over points are compiled and cost nanoseconds: fits ask thousands of times for each contour.
"""

from __future__ import annotations

import numpy as np

from cccd.geometry._jit import jit, jit_within
from cccd.geometry.arrays import FloatArray, IntArray
from cccd.geometry.polygons import DEGREE
from cccd.tolerances import RIDGE, TINY


def least_squares(knots: FloatArray, count: int, points: FloatArray, parameters: FloatArray) -> FloatArray:
    """Control points (n, 2) that minimise the squared distances to ``points`` (m, 2).

    Parameters
    ----------
    knots : (n + 7,) float array
    count : int
        n, at least 4.
    points : (m, 2) float array
    parameters : (m,) float array
        Ascending within one period.
    """
    band = np.zeros((count - DEGREE, 4))  # band[a, d] = N[a, a - d]
    border = np.zeros((3, count))  # last three rows of N, which close the curve
    right = np.zeros((count, 2))
    _add_points(points, *basis(knots, parameters), band, border, right)
    _add_bending(band, border, RIDGE * len(points) / count, 1)
    return _solve(band, border, right)


@jit
def _add_points(
    points: FloatArray,
    span: IntArray,
    value: FloatArray,
    band: FloatArray,
    border: FloatArray,
    right: FloatArray,
) -> None:
    body, count = len(band), len(right)
    for m in range(len(points)):
        for p in range(4):
            a = span[m] + p
            a -= count if a >= count else 0
            right[a, 0] += value[m, p] * points[m, 0]
            right[a, 1] += value[m, p] * points[m, 1]
            for q in range(4):
                b = span[m] + q
                b -= count if b >= count else 0
                if a >= body:
                    border[a - body, b] += value[m, p] * value[m, q]
                elif b <= a:
                    band[a, a - b] += value[m, p] * value[m, q]


def tangent_least_squares(
    knots: FloatArray,
    control: FloatArray,
    points: FloatArray,
    weights: FloatArray,
    parameters: FloatArray,
    sliding: float,
) -> FloatArray:
    """Control points (n, 2) one Gauss-Newton step on: distances are measured along the curve's normals.

    Where `least_squares` holds every point to its parameter, points may here slide along the tangent at
    little cost, as the parameter correction that follows lets them anyway. The pair then converges in a
    few rounds rather than hundreds (tangent distance minimisation, Wang, Pottmann and Liu 2006).

    Parameters
    ----------
    knots, control : arrays
        The closed spline to start from.
    points : (m, 2) float array
    weights : (m,) float array
    parameters : (m,) float array
        Ascending; foot points or near them.
    sliding : float
        Weight of the squared tangential distance against the normal one's, above 0.
    """
    count = len(control)
    band, border = np.zeros((2 * (count - DEGREE), 8)), np.zeros((6, 2 * count))
    right = np.zeros((2 * count, 1))
    curve, (span, value) = pieces(knots, control), basis(knots, parameters)
    into = parameters - knots[span + 3]
    _add_tangents(points, weights, sliding, curve, into, span, value, band, border, right)
    total = float(np.cumsum(weights)[-1])  # in their order: `sum` adds in pairs
    _add_bending(band, border, RIDGE * total / count, 2)
    return _solve(band, border, right).reshape((count, 2))


@jit
def _add_tangents(
    points: FloatArray,
    weights: FloatArray,
    sliding: float,
    curve: FloatArray,
    into: FloatArray,
    span: IntArray,
    value: FloatArray,
    band: FloatArray,
    border: FloatArray,
    right: FloatArray,
) -> None:
    count = len(curve)
    for m in range(len(points)):
        s = span[m]
        dx, dy = slope_at(curve[s], into[m], 0), slope_at(curve[s], into[m], 1)
        squared = max(dx * dx + dy * dy, TINY)
        slack = weights[m] * (1.0 - sliding) / squared
        weight_xx = weights[m] * sliding + slack * dy * dy
        weight_yy = weights[m] * sliding + slack * dx * dx
        weight_xy = -slack * dx * dy
        pull_x = weight_xx * points[m, 0] + weight_xy * points[m, 1]
        pull_y = weight_xy * points[m, 0] + weight_yy * points[m, 1]
        for p in range(4):
            a = s + p
            a -= count if a >= count else 0
            right[2 * a, 0] += value[m, p] * pull_x
            right[2 * a + 1, 0] += value[m, p] * pull_y
            for q in range(4):
                b = s + q
                b -= count if b >= count else 0
                if b > a and a < count - DEGREE:
                    continue  # the upper half is not kept
                shared = value[m, p] * value[m, q]
                xx, xy, yy = shared * weight_xx, shared * weight_xy, shared * weight_yy
                if a >= count - DEGREE:
                    row = 2 * (a - count + DEGREE)
                    border[row, 2 * b] += xx
                    border[row, 2 * b + 1] += xy
                    border[row + 1, 2 * b] += xy
                    border[row + 1, 2 * b + 1] += yy
                else:
                    gap = 2 * (a - b)
                    band[2 * a, gap] += xx
                    band[2 * a + 1, gap + 1] += xy
                    band[2 * a + 1, gap] += yy
                    if gap > 0:
                        band[2 * a, gap - 1] += xy


@jit
def _add_bending(band: FloatArray, border: FloatArray, weight: float, stride: int) -> None:
    """Add the control polygon's squared second differences to the normal equations.

    ``stride`` coordinates of a control point stand side by side in the unknowns.
    """
    body = len(band)
    count = border.shape[1] // stride
    for middle in range(count):
        for p in range(3):
            for q in range(3):
                term = weight * (-2.0 if p == 1 else 1.0) * (-2.0 if q == 1 else 1.0)
                for axis in range(stride):
                    a = (middle + p - 1) % count * stride + axis
                    b = (middle + q - 1) % count * stride + axis
                    if a >= body:
                        border[a - body, b] += term
                    elif b <= a:
                        band[a, a - b] += term


def _solve(band: FloatArray, border: FloatArray, right: FloatArray) -> FloatArray:
    """Solve a symmetric system of a band and a few last rows (Cholesky, Schur complement).

    All three are overwritten.

    Parameters
    ----------
    band : (n - b, w + 1) float array
        ``band[a, d] = N[a, a - d]``.
    border : (b, n) float array
        The last b rows of N.
    right : (n, c) float array
        Becomes the solution, which is returned.
    """
    _reduce(band, border, right, np.empty((len(band), right.shape[1] + len(border))))
    return right


@jit
def _reduce(band: FloatArray, border: FloatArray, right: FloatArray, columns: FloatArray) -> None:
    """Solve in place; ``columns`` is room for the right-hand sides, then the border's columns."""
    body, width = band.shape[0], band.shape[1] - 1
    edge, sides = len(border), right.shape[1]
    for a in range(body):
        for d in range(min(a, width), -1, -1):
            total = band[a, d]
            for e in range(d + 1, min(a, width) + 1):
                total -= band[a, e] * band[a - d, e - d]
            band[a, d] = np.sqrt(max(total, TINY)) if d == 0 else total / band[a - d, 0]
    for a in range(body):
        for c in range(sides + edge):
            total = right[a, c] if c < sides else border[c - sides, a]
            for d in range(1, min(a, width) + 1):
                total -= band[a, d] * columns[a - d, c]
            columns[a, c] = total / band[a, 0]
    for a in range(body):  # the last rows become the Schur complement
        for r in range(edge):
            lever = columns[a, sides + r]
            for c in range(edge):
                border[r, body + c] -= lever * columns[a, sides + c]
            for c in range(sides):
                right[body + r, c] -= lever * columns[a, c]
    for r in range(edge):  # it is small and positive definite: plain elimination
        for a in range(r + 1, edge):
            lever = border[a, body + r] / border[r, body + r]
            for c in range(r, edge):
                border[a, body + c] -= lever * border[r, body + c]
            for c in range(sides):
                right[body + a, c] -= lever * right[body + r, c]
    for r in range(edge - 1, -1, -1):
        for c in range(sides):
            total = right[body + r, c]
            for a in range(r + 1, edge):
                total -= border[r, body + a] * right[body + a, c]
            right[body + r, c] = total / border[r, body + r]
    for a in range(body - 1, -1, -1):
        for c in range(sides):
            total = columns[a, c]
            for r in range(edge):
                total -= columns[a, sides + r] * right[body + r, c]
            for d in range(1, min(body - 1 - a, width) + 1):
                total -= band[a + d, d] * right[a + d, c]
            right[a, c] = total / band[a, 0]


def project(
    knots: FloatArray, control: FloatArray, points: FloatArray, parameters: FloatArray, steps: int
) -> FloatArray:
    """Move each parameter towards the foot point of its point: Newton steps, order kept.

    Parameters
    ----------
    knots, control : arrays
        The closed spline.
    points : (m, 2) float array
    parameters : (m,) float array
        Ascending; changed in place.
    steps : int
        One more than the Newton steps.

    Returns
    -------
    (m,) float array
        Distances from the points to the curve at their parameters: upper bounds of the true ones.
    """
    last = np.nextafter(knots[-4], knots[3])
    distance = np.empty(len(points))
    _step(knots, pieces(knots, control), points, parameters, last, steps, distance)
    return distance


@jit
def _step(
    knots: FloatArray,
    curve: FloatArray,
    points: FloatArray,
    parameters: FloatArray,
    last: float,
    steps: int,
    distance: FloatArray,
) -> None:
    count, begin = len(curve), knots[3]
    for step in range(steps):
        s, before = 0, begin
        for m in range(len(points)):
            u = parameters[m]
            s = span_of(knots, count, u, s)
            piece, h = curve[s], u - knots[s + 3]
            dx, dy = points[m, 0] - value_at(piece, h, 0), points[m, 1] - value_at(piece, h, 1)
            if step == steps - 1:
                distance[m] = np.sqrt(dx * dx + dy * dy)
                continue
            slope_x, slope_y = slope_at(piece, h, 0), slope_at(piece, h, 1)
            speed = slope_x * slope_x + slope_y * slope_y
            newton = speed - dx * bend_at(piece, h, 0) - dy * bend_at(piece, h, 1)
            newton = max(newton, 0.5 * speed)  # far from the foot point Newton may turn round
            move = (dx * slope_x + dy * slope_y) / newton if newton > 0.0 else 0.0
            reach = knots[s + 4] - knots[s + 3]
            u = min(max(u + min(max(move, -reach), reach), before), last)
            parameters[m] = u
            before = u


# Spans: numbered, with knots and control points, as in `cccd.geometry.polygons` -----------------------


@jit_within
def span_of(knots: FloatArray, count: int, u: float, guess: int) -> int:
    """Span of ``u``, sought from a guess onwards (parameters ascend, so it is near)."""
    s = guess
    if u < knots[s + 3]:
        s = 0
    while s < count - 1 and u >= knots[s + 4]:
        s += 1
    return s


def basis(knots: FloatArray, parameters: FloatArray) -> tuple[IntArray, FloatArray]:
    """Spans (m,) of ascending parameters, and their four cubic basis functions (m, 4)."""
    span, value = np.empty(len(parameters), np.int64), np.empty((len(parameters), 4))
    _write_basis(knots, parameters, span, value)
    return span, value


@jit
def _write_basis(knots: FloatArray, parameters: FloatArray, span: IntArray, value: FloatArray) -> None:
    s = 0
    for m in range(len(parameters)):
        s = span_of(knots, len(knots) - 7, parameters[m], s)
        span[m] = s
        _write_values(knots, s, parameters[m], value[m])


@jit_within
def _write_values(knots: FloatArray, s: int, u: float, value: FloatArray) -> None:
    """Write the basis functions of a span into ``value`` (4,) by the recurrence of eq. (8)."""
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


def pieces(knots: FloatArray, control: FloatArray) -> FloatArray:
    """Polynomials (n, 4, 2) of all spans: coefficients of the powers of ``u - knots[s + 3]``."""
    out = np.zeros((len(control), 4, 2))
    _write_pieces(knots, control, out)
    return out


@jit
def _write_pieces(knots: FloatArray, control: FloatArray, out: FloatArray) -> None:
    count = len(control)
    x, first, second = np.empty(4), np.empty(3), np.empty(2)
    for s in range(count):
        u, reach = knots[s + 3], knots[s + 4] - knots[s + 3]
        if reach <= 0.0:
            continue
        for axis in range(2):
            for r in range(4):
                x[r] = control[(s + r) % count, axis]
            for r in range(3):
                first[r] = 3.0 * (x[r + 1] - x[r]) / (knots[s + r + 4] - knots[s + r + 1])
            for r in range(2):
                second[r] = 2.0 * (first[r + 1] - first[r]) / (knots[s + r + 4] - knots[s + r + 2])
            out[s, 3, axis] = (second[1] - second[0]) / reach / 6.0
            for level in range(1, 4):  # de Boor's algorithm for the curve and its derivatives
                for r in range(3, level - 1, -1):
                    low, high = knots[s + r], knots[s + r + 4 - level]
                    x[r] += ((u - low) / (high - low) - 1.0) * (x[r] - x[r - 1])
            for level in range(1, 3):
                for r in range(2, level - 1, -1):
                    low, high = knots[s + r + 1], knots[s + r + 4 - level]
                    first[r] += ((u - low) / (high - low) - 1.0) * (first[r] - first[r - 1])
            out[s, 0, axis], out[s, 1, axis], out[s, 2, axis] = x[3], first[2], second[0] / 2.0


@jit_within
def value_at(piece: FloatArray, h: float, axis: int) -> float:
    """One coordinate at distance ``h`` into a span."""
    return piece[0, axis] + h * (piece[1, axis] + h * (piece[2, axis] + h * piece[3, axis]))


@jit_within
def slope_at(piece: FloatArray, h: float, axis: int) -> float:
    """Its first derivative."""
    return piece[1, axis] + h * (2.0 * piece[2, axis] + h * 3.0 * piece[3, axis])


@jit_within
def bend_at(piece: FloatArray, h: float, axis: int) -> float:
    """Its second derivative."""
    return 2.0 * piece[2, axis] + 6.0 * h * piece[3, axis]
