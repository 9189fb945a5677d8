"""The decorator of functions that compiled functions call."""

from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar

_P = ParamSpec("_P")
_R = TypeVar("_R")

def register_jitable(**options: Any) -> Callable[[Callable[_P, _R]], Callable[_P, _R]]: ...
