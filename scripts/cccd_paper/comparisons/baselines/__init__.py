"""Every method that CCCD is compared with: one module per family, one entry per method.

`corner_detectors` (an 8-bit image to corner pixels), `reconstructions` (points to links), `contours` (corners
or an image and a seed circle to a curve), `surfaces` (a structure and its curves to a mesh) and `decoders`
(a boundary map's pixels and a seed to a curve). To add a method, write its function in a file of its own and
add its entry to its family: the comparisons, the tables and the report's notes read them.

A family is a module of its own, so that a change of one method runs again what compares its family alone.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

__all__ = ["Baseline", "always"]


def always() -> bool:
    """Say that a method needs no optional package."""
    return True


@dataclass(frozen=True)
class Baseline:
    """A method as the tables name it.

    Attributes
    ----------
    title : str
        Name in tables and figures.
    run : callable
        The function; its family's module says what it accepts and returns.
    note : str
        How this version relates to the authors': shown in the tables.
    available : callable
        Whether the packages that it needs are there; without them it has no row.
    package : str
        The optional one.
    """

    title: str
    run: Callable[..., Any]
    note: str
    available: Callable[[], bool] = always
    package: str = ""
