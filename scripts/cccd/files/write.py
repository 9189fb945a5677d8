"""Surfaces to files: the suffix chooses the format."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from cccd.containers import Structure
from cccd.errors import InputError
from cccd.extras import check_extra
from cccd.inputs.grid import Volume
from cccd.plugins import find
from cccd.settings.formats import FORMATS
from cccd.settings.surface import LoftSettings, TetrahedraSettings
from cccd.store import atomic_path, check_writable
from cccd.surface.surface import LoftedSurface

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


def format_of(path: str | Path) -> str:
    """Name the format that a file's suffix chooses.

    Raises
    ------
    InputError
        Another suffix; those known are listed.

    Examples
    --------
    >>> format_of("results/liver.nii.gz")
    'nii.gz'
    """
    name = Path(path).name.lower()
    known = [form for form in FORMATS if name.endswith(f".{form}")]
    if not known:
        names = ", ".join(f".{form}" for form in FORMATS)
        raise InputError(str(path), f"unknown surface format {Path(path).suffix!r}", f"choose one of {names}")
    return max(known, key=len)


def check_format(path: str | Path) -> None:
    """Raise `InputError` for an unknown suffix, or a format whose extra is not installed."""
    if needed := FORMATS[format_of(path)].extra:
        check_extra(needed, str(path))


def write_surface(
    path: str | Path, surface: LoftedSurface, options: ExportOptions | None = None
) -> dict[str, Any]:
    """Write a surface; the suffix chooses the format (`cccd.settings.formats.FORMATS`).

    Parameters
    ----------
    path : path
        Ends with the name of a format.
    surface : LoftedSurface
        In mm RAS.
    options : ExportOptions, optional
        For formats that lie on the scan, solids, and tetrahedra.

    Returns
    -------
    dict
        What a solid is worth, see `cccd_solids.build.write_solids`; empty for other formats.

    Raises
    ------
    InputError
        For a folder, another suffix, a format whose extra is not installed, or where nothing can be written.
    """
    options = options or ExportOptions()
    if Path(path).is_dir():
        raise InputError(str(path), "that is a folder", "give the name of a file in it")
    check_format(path)
    check_writable(path)
    write = find(FORMATS[format_of(path)].writer)
    with atomic_path(path) as temporary:
        try:
            return write(temporary, surface, options) or {}
        except InputError as error:
            if error.location != str(temporary):
                raise
            raise InputError(str(path), error.problem, error.hint) from None
