"""libigl, which runs in one thread: jobs share a machine. Its types are looser than what it returns."""

import os
from typing import Any, cast

import igl as untyped  # pyright: ignore[reportMissingTypeStubs]
import igl.predicates as untyped_predicates  # pyright: ignore[reportMissingTypeStubs]

os.environ.setdefault("IGL_NUM_THREADS", "1")  # read once, by its first function

igl, predicates = cast(Any, untyped), cast(Any, untyped_predicates)
