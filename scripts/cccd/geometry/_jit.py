"""The compiler for loops over points, pixels and triangles, with types that a checker understands.

A first run waits for it, so compiled functions hold the loops alone: Python allocates their arrays, as every
``np.empty`` of another shape or type is one more function to compile.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import ParamSpec, TypeVar

from numba import njit
from numba.extending import register_jitable

__all__ = ["jit", "jit_dividing_by_zero", "jit_within"]

P = ParamSpec("P")
R = TypeVar("R")


def jit(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function when it is first called, and keep the machine code beside its file."""
    return njit(cache=True)(function)


def jit_dividing_by_zero(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function likewise; division by zero gives infinity or NaN in it, as in NumPy."""
    return njit(cache=True, error_model="numpy")(function)


def jit_within(function: Callable[P, R]) -> Callable[P, R]:
    """Let compiled functions call this one: it is compiled with them, without what Python needs to call it."""
    return register_jitable(function)
