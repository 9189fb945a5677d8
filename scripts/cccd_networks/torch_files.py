"""Files of torch: written whole or not at all."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch

from cccd.store import atomic_path


def save_content(path: Path, content: Mapping[str, Any]) -> None:
    """Write tensors and plain values, compressed, all or nothing."""
    buffer = io.BytesIO()
    torch.save(content, buffer)
    with (
        atomic_path(path) as temporary,
        zipfile.ZipFile(buffer) as parts,
        zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as archive,
    ):
        for part in parts.infolist():
            archive.writestr(part, parts.read(part), zipfile.ZIP_DEFLATED)
