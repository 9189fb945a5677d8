"""Binary PLY with float64 vertices, so that nothing of the mesh's soundness is rounded away."""

from __future__ import annotations

from pathlib import Path

from cccd.geometry.ply import write_ply
from cccd.surface.formats import NOTE, Scan
from cccd.surface.surface import Surface

__all__ = ["write"]


def write(path: Path, surface: Surface, scan: Scan) -> None:
    """Write the mesh in mm RAS."""
    write_ply(path, surface.mesh, NOTE)
