"""The mesh within DICOM: encapsulated STL (M3D), for archives that keep models for printing and planning."""

from __future__ import annotations

from pathlib import Path

from cccd.surface.formats import Scan
from cccd.surface.surface import Surface
from cccd.volumes.model_export import write_encapsulated_stl

__all__ = ["write"]


def write(path: Path, surface: Surface, scan: Scan) -> None:
    """Write the mesh in mm LPS, with references to its scan."""
    write_encapsulated_stl(
        path, surface.mesh, name=scan.organ, reference=scan.series, keep_patient=scan.keep_patient
    )
