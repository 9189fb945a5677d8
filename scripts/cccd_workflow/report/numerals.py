"""Numbers as the notes and the tables write them."""

from __future__ import annotations

import math
from numbers import Integral, Real
from typing import Any

import numpy as np

#: Numbers that need more decimals are written with an exponent.
_MOST_DECIMALS = 7


def typeset(text: str) -> str:
    """Set a formatted number with narrow spaces between thousands and a true minus sign."""
    return text.replace(",", "\u202f").replace("-", "−")


def number(value: Any, decimals: int | None = None) -> str:
    r"""Write a number: thousands separated by narrow spaces, a true minus sign, a dash for what is missing.

    Without ``decimals`` a fraction is given with four significant digits.

    >>> number(0.98491), number(12345), number(-0.5, 2), number(float("nan")), number(12345.6)
    ('0.9849', '12\u202f345', '−0.50', '–', '12\u202f346')
    """
    if value is None or (isinstance(value, Real) and not math.isfinite(value)):
        return "–"
    if isinstance(value, (bool, np.bool_)):
        return "yes" if value else "no"
    if isinstance(value, Integral):
        return typeset(f"{int(value):,}")
    if decimals is None:
        decimals = shared_decimals(np.array([value], float))
    return typeset(f"{float(value):z,.{decimals}f}" if decimals <= _MOST_DECIMALS else f"{float(value):.1e}")


def shared_decimals(values: np.ndarray) -> int:
    """Choose how many decimals a column needs: none for whole numbers, else four digits of the largest."""
    values = np.abs(values[np.isfinite(values)])
    largest = values.max(initial=0)
    for few in (0, 1):
        if largest < 10 ** (4 - few) and np.array_equal(np.round(values, few), values):
            return few
    return int(np.clip(3 - np.floor(np.log10(largest)), 0, 12)) if largest > 0 else 0
