"""Binary STL."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np

from cccd.surface.formats import NOTE, Scan
from cccd.surface.surface import Surface

__all__ = ["write"]


def write(path: Path, surface: Surface, scan: Scan) -> None:
    """Write the mesh in mm RAS."""
    corners = surface.vertices[surface.faces]
    table = np.zeros(len(corners), [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    table["normal"] = surface.mesh.unit_normals
    table["corners"] = corners
    # A binary STL must not begin with "solid": readers would take it for text.
    path.write_bytes(NOTE.encode().ljust(80) + struct.pack("<I", len(corners)) + table.tobytes())
