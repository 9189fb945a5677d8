"""A label map on the scan's grid (NIfTI)."""

from __future__ import annotations

from pathlib import Path

from cccd.surface.formats import Scan
from cccd.surface.surface import Surface
from cccd.volumes.nifti_export import write_label_map

__all__ = ["write"]


def write(path: Path, surface: Surface, scan: Scan) -> None:
    """Write the voxels inside; slices that were drawn, where only some were, as they were drawn."""
    write_label_map(path, surface.mesh, surface.frame, drawn=scan.drawn)
