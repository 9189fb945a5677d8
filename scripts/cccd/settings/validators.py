"""Checks that more than one section's fields need."""

from __future__ import annotations

__all__ = ["without_repeats"]


def without_repeats(values: tuple[str, ...]) -> tuple[str, ...]:
    """Return the names; refuse any that comes twice."""
    repeated = sorted({name for name in values if values.count(name) > 1})
    if repeated:
        raise ValueError(f"{', '.join(repeated)} stands there twice")
    return values
