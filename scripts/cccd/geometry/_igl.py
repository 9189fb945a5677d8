"""libigl's functions, on one thread: jobs share a machine."""

from __future__ import annotations

import os
from typing import Any, cast

os.environ.setdefault("IGL_NUM_THREADS", "1")  # read once, when the first function runs

import igl as _igl  # pyright: ignore[reportMissingTypeStubs]

__all__ = ["igl"]

#: Its types are looser than what it returns.
igl = cast(Any, _igl)
