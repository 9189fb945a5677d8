"""Functions by their dotted path: what a job is to call."""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Mapping
from typing import Any

__all__ = ["call", "find"]


def find(path: str) -> Any:
    """Look up a function, or what else a module has, by its dotted path.

    >>> find("math.hypot")(3, 4)
    5.0
    """
    module, name = path.rsplit(".", 1)
    return getattr(importlib.import_module(module), name)


def call(function: str, arguments: Mapping[str, Any]) -> Any:
    """Call a function with those of the arguments that it has parameters for.

    >>> call("statistics.fmean", {"data": [3, 4], "weights": None, "unused": 1})
    3.5
    """
    found = find(function)
    return found(**{name: arguments[name] for name in inspect.signature(found).parameters})
