"""Uniform cubic B-spline bases (eqs. 7-9) and least-squares operators for them."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import BSpline

__all__ = ["DEGREE", "basis", "closed_knots", "least_squares", "open_knots"]

#: Both directions are cubic, eq. (9).
DEGREE = 3


def closed_knots(count: int, degree: int = DEGREE) -> np.ndarray:
    """Knots (count + 2 * degree + 1,) of a closed uniform spline on [0, 1]."""
    return np.arange(-degree, count + degree + 1) / count


def open_knots(count: int, length: float, degree: int = DEGREE) -> np.ndarray:
    """Knots (count + degree + 1,) of a clamped uniform spline on [0, length]."""
    inner = np.linspace(0.0, length, count - degree + 1)
    return np.concatenate([np.zeros(degree), inner, np.full(degree, length)])


def basis(at: np.ndarray, knots: np.ndarray, degree: int, closed: bool, derivative: int = 0) -> np.ndarray:
    """Values (P, n) of the n basis functions, or of a derivative of them, at parameters (P,).

    A closed basis wraps: its last ``degree`` functions are added onto the first.
    """
    low, high = knots[degree], knots[-degree - 1]
    at = np.asarray(at, float)
    at = low + np.mod(at - low, high - low) if closed else np.clip(at, low, high)
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


def least_squares(design: np.ndarray, roughness: float, closed: bool) -> np.ndarray:
    """Operator (n, P) from samples to control points that minimises squares plus a little roughness.

    The penalty on second differences of the control points only settles what the samples leave open.
    """
    count = design.shape[1]
    difference = np.roll(np.eye(count), 1, 0) - 2 * np.eye(count) + np.roll(np.eye(count), -1, 0)
    if not closed:
        difference = difference[1:-1]
    normal = design.T @ design
    weight = roughness * np.trace(normal) / count
    return np.linalg.solve(normal + weight * difference.T @ difference + 1e-12 * np.eye(count), design.T)
