"""Contours on the scan's slices (RTSTRUCT)."""

from __future__ import annotations

from pathlib import Path

from cccd.surface.formats import Scan
from cccd.surface.surface import Surface
from cccd.volumes.clinical_export import write_rtstruct

__all__ = ["write"]


def write(path: Path, surface: Surface, scan: Scan) -> None:
    """Write the mesh's sections with planes."""
    write_rtstruct(
        path,
        surface.mesh,
        surface.frame,
        name=scan.organ,
        spacing_mm=scan.contour_spacing_mm,
        reference=scan.series,
        keep_patient=scan.keep_patient,
    )
