"""Wavefront OBJ."""

from __future__ import annotations

from pathlib import Path
from typing import Any, cast

from cccd.surface.formats import NOTE, Scan
from cccd.surface.surface import Surface

__all__ = ["write"]


def write(path: Path, surface: Surface, scan: Scan) -> None:
    """Write the mesh in mm RAS."""
    mesh = cast(Any, surface.mesh.to_trimesh())
    path.write_text(mesh.export(file_type="obj", header=NOTE, include_normals=False), encoding="utf-8")
