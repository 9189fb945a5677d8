"""Binary STL."""

from __future__ import annotations

import struct

import numpy as np

from cccd.geometry.mesh import Mesh

__all__ = ["binary_stl"]


def binary_stl(mesh: Mesh, note: str) -> bytes:
    """Write a mesh as binary STL, in its own unit and frame, of which a note of at most 80 letters tells.

    A binary STL must not begin with "solid": readers would take it for text.
    """
    corners = mesh.vertices[mesh.faces]
    table = np.zeros(len(corners), [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    table["normal"] = mesh.unit_normals
    table["corners"] = corners
    head = note.encode("ascii", "replace").removeprefix(b"solid")[:80].ljust(80)
    return head + struct.pack("<I", len(corners)) + table.tobytes()
