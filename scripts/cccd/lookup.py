"""Functions by their dotted path: what a job is to call."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import Any

__all__ = ["find"]


def find(function: str) -> Callable[..., Any]:
    """Look up a function by its dotted path.

    >>> find("math.hypot")(3, 4)
    5.0
    """
    module, name = function.rsplit(".", 1)
    return getattr(importlib.import_module(module), name)
