"""Knots of B-splines (eqs. 7-9)."""

from __future__ import annotations

import numpy as np

from cccd.geometry.arrays import FloatArray

__all__ = [
    "DEGREE",
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
