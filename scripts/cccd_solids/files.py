"""Closed solids for CAD: STEP AP242, IGES 5.3, and OpenCASCADE's own format, without names and colours."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from cccd.files import ExportOptions
from cccd.surface.surface import LoftedSurface
from cccd_solids.build import build_solids, write_solids


def write(path: Path, surface: LoftedSurface, options: ExportOptions) -> dict[str, Any]:
    """Write the surface's bodies as solids in mm RAS, a product for each; the suffix chooses the format."""
    solids = build_solids(surface, options.settings.step_tolerance_mm)
    return write_solids(path, options.organ, solids, path.suffix[1:].lower())
