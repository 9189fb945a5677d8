"""The compiler for loops over points, pixels and triangles, with types that a checker understands."""

from __future__ import annotations

from collections.abc import Callable
from typing import ParamSpec, TypeVar

from numba import njit

__all__ = ["jit", "jit_dividing_by_zero"]

P = ParamSpec("P")
R = TypeVar("R")


def jit(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function when it is first called, and keep the machine code beside its file."""
    return njit(cache=True)(function)


def jit_dividing_by_zero(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function likewise; division by zero gives infinity or NaN in it, as in NumPy."""
    return njit(cache=True, error_model="numpy")(function)
