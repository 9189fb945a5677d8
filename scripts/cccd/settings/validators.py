"""Checks that more than one section's fields need."""

from __future__ import annotations

from itertools import pairwise
from typing import TypeVar

__all__ = ["ascending", "without_repeats"]

_Numbers = TypeVar("_Numbers", bound=tuple[float, ...])


def ascending(values: _Numbers) -> _Numbers:
    """Return the numbers; refuse them where one is not larger than that before it."""
    for before, after in pairwise(values):
        if not before < after:
            raise ValueError(
                f"{after:g} stands after {before:g}, and each must be larger than that before it"
            )
    return values


def without_repeats(values: tuple[str, ...]) -> tuple[str, ...]:
    """Return the names; refuse any that comes twice."""
    repeated = sorted({name for name in values if values.count(name) > 1})
    if repeated:
        raise ValueError(f"{', '.join(repeated)} stands there twice")
    return values
