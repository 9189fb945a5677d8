"""B-spline bases (eqs. 7-9): knots, values and derivatives."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import BSpline

from cccd.geometry.arrays import FloatArray

__all__ = [
    "DEGREE",
    "basis",
    "closed_knots",
    "open_knots",
]

#: Both directions are cubic, eq. (9).
DEGREE = 3


def closed_knots(count: int, degree: int = DEGREE) -> FloatArray:
    """Knots (count + 2 * degree + 1,) of a closed uniform spline on [0, 1]."""
    return np.arange(-degree, count + degree + 1) / count


def open_knots(count: int, length: float, degree: int = DEGREE) -> FloatArray:
    """Knots (count + degree + 1,) of a clamped uniform spline on [0, length]."""
    inner = np.linspace(0.0, length, count - degree + 1)
    return np.concatenate([np.zeros(degree), inner, np.full(degree, length)])


def basis(at: FloatArray, knots: FloatArray, degree: int, closed: bool, derivative: int = 0) -> FloatArray:
    """Values (P, n) of the n basis functions, or of a derivative of them, at parameters (P,).

    A closed basis wraps: its last ``degree`` functions are added onto the first.
    """
    at = _within(at, knots, degree, closed)
    functions = len(knots) - degree - 1
    if derivative > degree:
        full = np.zeros((len(at), functions))
    elif derivative:
        full = BSpline(knots, np.eye(functions), degree).derivative(derivative)(at)
    else:
        full = BSpline.design_matrix(at, knots, degree).toarray()
    if not closed:
        return full
    count = functions - degree
    wrapped = full[:, :count].copy()
    for extra in range(degree):  # a spline of fewer than `degree` points wraps more than once
        wrapped[:, extra % count] += full[:, count + extra]
    return wrapped


def _within(at: FloatArray, knots: FloatArray, degree: int, closed: bool) -> FloatArray:
    """Parameters on the base period: a closed direction wraps, an open one ends."""
    low, high = float(knots[degree]), float(knots[-degree - 1])
    at = np.asarray(at, float)
    return low + np.mod(at - low, high - low) if closed else np.clip(at, low, high)
