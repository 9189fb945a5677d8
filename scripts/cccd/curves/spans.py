"""Spans of closed cubic B-splines, compiled: fits ask thousands of times for each contour.

Spans, knots and control points are numbered as in `cccd.geometry.closed_splines`.
"""

from __future__ import annotations

import numpy as np

from cccd.geometry._jit import jit, jit_within
from cccd.geometry.arrays import FloatArray, IntArray

__all__ = ["basis", "bend_at", "pieces", "slope_at", "span_of", "value_at"]


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
