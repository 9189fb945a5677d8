"""The files that a surface is written to: one module per format, named after it.

``nii_gz`` is for .nii.gz, and ``threemf`` for .3mf, as which no module can be imported. Each has a function
``write(path, surface, scan)``. The configuration, the rules and `write_surface` go by the modules that are
here, so a format is added by adding its module.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from cccd.containers import Structure
from cccd.settings.surface import LoftSettings, TetrahedraSettings

__all__ = ["COLOUR", "NOTE", "Scan"]

#: Red, green and blue (sRGB, 0 to 1) of an organ that nothing gives a colour.
COLOUR = (0.80, 0.47, 0.40)

#: Written wherever a format has room for text; ``SPACE=RAS`` is what 3D Slicer looks for.
NOTE = "CCCD surface; unit mm; SPACE=RAS"


_DEFAULT = LoftSettings()


@dataclass(frozen=True)
class Scan:
    """What some formats need besides: those that lie on the scan, and solids.

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
    """

    organ: str = "surface"
    contour_spacing_mm: float | None = None
    series: Path | None = None
    keep_patient: bool = False
    drawn: Structure | None = None
    tolerance_mm: float = _DEFAULT.step_tolerance_mm
    tetrahedra: TetrahedraSettings = _DEFAULT.tetrahedra
