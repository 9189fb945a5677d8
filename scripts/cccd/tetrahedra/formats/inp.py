"""Abaqus' and CalculiX' input."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from cccd.surface.formats import Scan
from cccd.surface.surface import Surface
from cccd.tetrahedra.build import fill_surface
from cccd.tetrahedra.filling import TetrahedralMesh
from cccd.tetrahedra.formats import HEAD, rows

__all__ = ["write", "write_tetrahedra"]


def write_tetrahedra(path: Path, filled: TetrahedralMesh) -> None:
    """Write Abaqus' and CalculiX' format: the mesh and its sets, to be included in a model.

    Of each organ an ``ELSET`` of linear tetrahedra; of each boundary an element surface, for pressures, and
    a node set ``N_...``, for supports. Names are in capitals, as CalculiX reads them, without hyphens.
    """
    path.write_text("\n".join(_inp_lines(filled)) + "\n", encoding="ascii")


def _inp_lines(filled: TetrahedralMesh) -> Iterator[str]:
    numbers = np.arange(1, len(filled.tetrahedra) + 1)
    yield f"** {HEAD}"
    yield "*NODE, NSET=NALL"
    yield from (f"{n}, {x:.9g}, {y:.9g}, {z:.9g}" for n, (x, y, z) in enumerate(filled.vertices, 1))
    names = [_plain(name) for name in filled.names]
    for n, name in enumerate(names):
        own = filled.regions == n
        yield f"*ELEMENT, TYPE=C3D4, ELSET={name}"
        yield rows(np.column_stack([numbers[own], filled.tetrahedra[own] + 1]), "%d", ", ")
    yield "*ELSET, ELSET=EALL"
    yield from (f"{name}," for name in names)
    for n, name in enumerate(map(_plain, filled.group_names)):
        own = filled.groups == n
        yield f"*SURFACE, NAME={name}, TYPE=ELEMENT"
        yield from (f"{element + 1}, S{side + 1}" for element, side in filled.sides[own].tolist())
        yield f"*NSET, NSET=N_{name}"
        yield from (f"{node + 1}," for node in np.unique(filled.triangles[own]).tolist())


def _plain(name: str) -> str:
    return name.upper().replace("-", "_")


def write(path: Path, surface: Surface, scan: Scan) -> dict[str, Any]:
    """Fill the surface, and write the tetrahedra."""
    filled, report = fill_surface(surface, scan)
    write_tetrahedra(path, filled)
    return {"format": "inp", **report}
