"""Voxels on the DICOM series that the surface came from (SEG)."""

from __future__ import annotations

from pathlib import Path

from cccd.surface.formats import Scan
from cccd.surface.surface import Surface
from cccd.volumes.seg_export import write_seg

__all__ = ["write"]


def write(path: Path, surface: Surface, scan: Scan) -> None:
    """Write the voxels whose centres lie inside."""
    write_seg(path, surface.mesh, name=scan.organ, reference=scan.series, keep_patient=scan.keep_patient)
