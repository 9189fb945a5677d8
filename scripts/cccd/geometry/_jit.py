"""The compiler for loops over points, pixels and triangles, with types that a checker understands."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar, cast

import numba

__all__ = ["jit", "jit_dividing_by_zero"]

P = ParamSpec("P")
R = TypeVar("R")

_njit = cast(Any, numba).njit  # Numba comes without types


def jit(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function when it is first called, and keep the machine code beside its file."""
    return cast("Callable[P, R]", _njit(cache=True)(function))


def jit_dividing_by_zero(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function likewise; division by zero gives infinity or NaN in it, as in NumPy."""
    return cast("Callable[P, R]", _njit(cache=True, error_model="numpy")(function))
