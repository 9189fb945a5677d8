"""The one decorator of Numba that the library uses; Numba ships no types."""

from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar, overload

_P = ParamSpec("_P")
_R = TypeVar("_R")

@overload
def njit(function: Callable[_P, _R], /) -> Callable[_P, _R]: ...
@overload
def njit(*, cache: bool = ..., **options: Any) -> Callable[[Callable[_P, _R]], Callable[_P, _R]]: ...
