"""libigl, in one thread: its types are looser than what it returns."""

from __future__ import annotations

import os
from typing import Any, cast

os.environ.setdefault("IGL_NUM_THREADS", "1")  # jobs share a machine; read once, by its first function

import igl as _igl  # pyright: ignore[reportMissingTypeStubs]
import igl.predicates  # pyright: ignore[reportMissingTypeStubs, reportUnusedImport]

igl = cast(Any, _igl)
