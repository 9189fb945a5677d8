"""Closed cubic B-spline curves of the plane.

A closed spline with n control points has n spans. Span ``s`` lies between the knots ``t[s + 3]`` and
``t[s + 4]`` and is ruled by the control points ``s .. s + 3`` (mod n). The knots are n + 7, as SciPy wants
them for the control points with the first three repeated at the end. Fits use `cccd.curves.periodic`.
"""

from __future__ import annotations

import numpy as np

from cccd.geometry.arrays import FloatArray

#: Cubic throughout (equations 6-9).
DEGREE = 3


def extend_knots(breaks: FloatArray, period: float) -> FloatArray:
    """Knots (n + 7,) of a closed cubic spline from its n breaks, ascending in ``[0, period)``."""
    turn, index = np.divmod(np.arange(-DEGREE, len(breaks) + DEGREE + 1), len(breaks))
    return breaks[index] + turn * period


def evaluate(knots: FloatArray, control: FloatArray, parameters: FloatArray) -> FloatArray:
    """Points (m, 2) at parameters within the base period, by de Boor's algorithm for all of them at once."""
    span = np.minimum(np.searchsorted(knots[DEGREE:], parameters, side="right"), len(control)) - 1
    past = parameters - knots[span + np.arange(2 * DEGREE + 1)[:, None]]
    points = [control.T[:, (span + r) % len(control)] for r in range(DEGREE + 1)]
    for level in range(1, DEGREE + 1):
        for r in range(DEGREE, level - 1, -1):
            share = past[r] / (past[r] - past[r + DEGREE + 1 - level])
            points[r] = points[r - 1] + share * (points[r] - points[r - 1])
    return points[DEGREE].T
