"""Binary STL."""

from __future__ import annotations

from pathlib import Path

from cccd.geometry.stl import binary_stl
from cccd.surface.formats import NOTE, Scan
from cccd.surface.surface import Surface

__all__ = ["write"]


def write(path: Path, surface: Surface, scan: Scan) -> None:
    """Write the mesh in mm RAS."""
    path.write_bytes(binary_stl(surface.mesh, NOTE))
