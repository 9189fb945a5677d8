"""The compiler for loops over points, pixels and triangles, with types that a checker understands.

A first run waits for it, so compiled functions hold the loops alone: Python allocates their arrays, as every
``np.empty`` of another shape or type is one more function to compile.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import ParamSpec, TypeVar

from numba import njit
from numba.extending import register_jitable

P = ParamSpec("P")
R = TypeVar("R")

#: No function is handed to compiled code as a pointer, for which Numba would compile a wrapper of each.
_FEWER_WRAPPERS = {"no_cfunc_wrapper": True}


def jit(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function when it is first called, and keep the machine code beside its file."""
    return njit(cache=True, **_FEWER_WRAPPERS)(function)


def jit_dividing_by_zero(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function likewise; division by zero gives infinity or NaN in it, as in NumPy."""
    return njit(cache=True, **_FEWER_WRAPPERS, error_model="numpy")(function)


def jit_within(function: Callable[P, R]) -> Callable[P, R]:
    """Let compiled functions call this one: it is compiled with them, without what Python calls it by."""
    return register_jitable(**_FEWER_WRAPPERS)(function)
