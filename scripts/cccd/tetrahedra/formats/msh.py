"""Gmsh's format 2.2, in text."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from cccd.geometry.arrays import IntArray
from cccd.surface.formats import Scan
from cccd.surface.surface import Surface
from cccd.tetrahedra.build import fill_surface
from cccd.tetrahedra.filling import TetrahedralMesh
from cccd.tetrahedra.formats import HEAD, rows

__all__ = ["write", "write_tetrahedra"]

#: Gmsh's numbers of a triangle and a tetrahedron.
_TRIANGLE, _TETRAHEDRON = 2, 4


def write_tetrahedra(path: Path, filled: TetrahedralMesh) -> None:
    """Write Gmsh's format 2.2, which every reader knows: a physical group per organ and per boundary."""
    groups = [(2, n, name) for n, name in enumerate(filled.group_names, 1)]
    groups += [(3, n, name) for n, name in enumerate(filled.names, len(groups) + 1)]
    numbers = np.arange(1, len(filled.vertices) + 1)
    faces = _elements(1, _TRIANGLE, filled.groups + 1, filled.triangles + 1)
    solids = _elements(
        len(faces) + 1,
        _TETRAHEDRON,
        filled.regions + 1 + len(filled.group_names),
        filled.tetrahedra + 1,
    )
    parts = [
        f"$Comments\n{HEAD}\n$EndComments",
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat",
        f"$PhysicalNames\n{len(groups)}",
        *(f'{dimension} {number} "{name}"' for dimension, number, name in groups),
        f"$EndPhysicalNames\n$Nodes\n{len(numbers)}",
        *(f"{n} {x:.9g} {y:.9g} {z:.9g}" for n, (x, y, z) in zip(numbers, filled.vertices, strict=True)),
        f"$EndNodes\n$Elements\n{len(faces) + len(solids)}",
        rows(faces, "%d"),
        rows(solids, "%d"),
        "$EndElements\n",
    ]
    path.write_text("\n".join(parts), encoding="ascii")


def _elements(first: int, kind: int, tags: IntArray, corners: IntArray) -> IntArray:
    """Rows of Gmsh's elements: number, kind, two tags (physical group, entity), vertices."""
    count = len(corners)
    fixed = [np.arange(first, first + count), np.full(count, kind), np.full(count, 2), tags, tags]
    return np.column_stack([*fixed, corners])


def write(path: Path, surface: Surface, scan: Scan) -> dict[str, Any]:
    """Fill the surface, and write the tetrahedra."""
    filled, report = fill_surface(surface, scan)
    write_tetrahedra(path, filled)
    return {"format": "msh", **report}
