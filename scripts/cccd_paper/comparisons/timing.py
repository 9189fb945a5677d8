"""Processor time of what is compared: a machine that other jobs share does not change it."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from typing import Any


def timed(make: Callable[..., Any], *arguments: Any) -> tuple[Any, float]:
    """Return what a function makes, and its processor seconds, those of programs that it runs included."""
    start = _spent()
    made = make(*arguments)
    return made, _spent() - start


def _spent() -> float:
    children = os.times()
    return time.process_time() + children.children_user + children.children_system
