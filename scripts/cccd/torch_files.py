"""Files of torch: written whole or not at all."""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch

from cccd.store import atomic_path

__all__ = ["save_content"]


def save_content(path: Path, content: Mapping[str, Any]) -> None:
    """Write tensors and plain values, all or nothing."""
    buffer = io.BytesIO()  # torch reports a full disk as an internal error
    torch.save(content, buffer)
    with atomic_path(path) as temporary:
        temporary.write_bytes(buffer.getbuffer())
