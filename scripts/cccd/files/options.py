"""What some formats need besides the surface."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from cccd.containers import Structure
from cccd.inputs.grid import Volume
from cccd.settings.surface import LoftSettings, TetrahedraSettings

__all__ = ["ExportOptions"]

_DEFAULT = LoftSettings()


@dataclass(frozen=True)
class ExportOptions:
    """What some formats need besides: those that lie on the scan, solids, and tetrahedra.

    Attributes
    ----------
    organ : str
        Name of the structure.
    contour_spacing_mm : float or None
        Distance of contours' planes; None for the scan's slices.
    series : Path or None
        Folder of the DICOM series that the file shall refer to.
    keep_patient : bool
        Whether that file says who the patient is.
    drawn : Structure or None
        What was drawn, where only some slices were: a label map keeps those as they are.
    tolerance_mm : float
        99 % of a solid's surface shall lie so near to the mesh.
    tetrahedra : TetrahedraSettings
        Section ``surface.tetrahedra`` of the configuration.
    scan : Volume or None
        Whose grey values tetrahedra get.
    filled : dict
        Tetrahedra that were made of the surface, with their report, by settings: each further format of the
        same object gets these, as filling takes minutes.
    """

    organ: str = "surface"
    contour_spacing_mm: float | None = None
    series: Path | None = None
    keep_patient: bool = False
    drawn: Structure | None = None
    tolerance_mm: float = _DEFAULT.step_tolerance_mm
    tetrahedra: TetrahedraSettings = _DEFAULT.tetrahedra
    scan: Volume | None = None
    filled: dict[str, tuple[Any, dict[str, Any]]] = field(
        default_factory=dict[str, tuple[Any, dict[str, Any]]]
    )
