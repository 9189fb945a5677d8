"""IGES 5.3: manifold solids in mm RAS, for programs that read no STEP."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from cccd.solids.build import build_solids, write_solids
from cccd.surface.formats import Scan
from cccd.surface.surface import Surface

__all__ = ["write"]


def write(path: Path, surface: Surface, scan: Scan) -> dict[str, Any]:
    """Write the surface's bodies as solids."""
    solids = build_solids(surface, scan.tolerance_mm)
    return write_solids(path, scan.organ, solids, "iges")
