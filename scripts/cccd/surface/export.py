"""Surfaces to files and back: meshes for viewers, solids for CAD, label maps and contours on the scan.

Everything is in mm RAS, and says so, but where a standard wants it otherwise (glTF: metres with y up;
DICOM: LPS). 3D Slicer takes meshes for LPS unless a comment ``SPACE=RAS`` says otherwise, so that comment is
there in the form Slicer reads.
"""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from cccd.errors import InputError
from cccd.extras import MESHER_EXTRAS, check_extra
from cccd.geometry.mesh import Mesh
from cccd.geometry.ply import read_ply
from cccd.geometry.subdivision import ControlMesh
from cccd.settings.surface import SOLID_FORMATS, SURFACE_FORMATS, TETRAHEDRA_FORMATS
from cccd.store import (
    atomic_path,
    check_writable,
    read_bodies,
    read_report,
    read_surface_frame,
)
from cccd.surface.formats import Scan
from cccd.surface.surface import Surface

__all__ = ["Scan", "check_format", "format_of", "read_surface", "write_surface"]

#: Vertices this near are the same; a PLY mesh keeps them exactly, older ones as single floats.
SAME_POINT_MM = 1e-3
#: The extras that formats are written with.
_NEEDS = dict.fromkeys(SOLID_FORMATS, "cad") | {
    "dcm": "dicom",
    "stl.dcm": "dicom",
    "seg.dcm": "dicom",
    "3mf": "print",
    "vtp": "view",
    "usd": "usd",
    "usda": "usd",
    "usdc": "usd",
}


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
    known = [form for form in SURFACE_FORMATS if name.endswith(f".{form}")]
    if not known:
        names = ", ".join(f".{form}" for form in SURFACE_FORMATS)
        raise InputError(str(path), f"unknown surface format {Path(path).suffix!r}", f"choose one of {names}")
    return max(known, key=len)


def check_format(path: str | Path, mesher: str = "ftetwild") -> None:
    """Raise `InputError` for an unknown suffix, or a format whose extra is not installed."""
    form = format_of(path)
    needed = MESHER_EXTRAS[mesher] if form in TETRAHEDRA_FORMATS else _NEEDS.get(form)
    if needed:
        check_extra(needed, str(path))


def write_surface(path: str | Path, surface: Surface, scan: Scan | None = None) -> dict[str, Any]:
    """Write a surface; the suffix chooses the format (`cccd.surface.formats`, `cccd.solids.formats`).

    Parameters
    ----------
    path : path
        Ends with the name of a format.
    surface : Surface
        In mm RAS.
    scan : Scan, optional
        For formats that lie on the scan, and solids.

    Returns
    -------
    dict
        What a solid is worth, see `cccd.solids.build.write_solids`; empty for other formats.

    Raises
    ------
    InputError
        For another suffix, a format whose extra is not installed, or a folder that nothing can be written to.
    """
    scan = scan or Scan()
    check_format(path, scan.tetrahedra.mesher)
    check_writable(path)
    module = import_module(SURFACE_FORMATS[format_of(path)])
    with atomic_path(path) as temporary:
        try:
            return module.write(temporary, surface, scan) or {}
        except InputError as error:
            if error.location != str(temporary):
                raise
            raise InputError(str(path), error.problem, error.hint) from None


def read_surface(path: str | Path, mesh_path: str | Path) -> Surface:
    """Read back what the lofting wrote: ``surface.h5`` and the PLY mesh.

    Organs that share their walls have another mesh than their control meshes': it has no ``bodies``.
    """
    mesh, bodies = read_ply(mesh_path), read_bodies(path)
    bodies = bodies if _is_of(mesh, bodies) else []
    return Surface(bodies, mesh, read_surface_frame(path), read_report(path))


def _is_of(mesh: Mesh, bodies: Sequence[ControlMesh]) -> bool:
    """Whether a mesh is a tessellation of control meshes: it has their limits among its vertices."""
    limits = [body.tessellate(0).vertices for body in bodies]
    return all(bool(np.all(cKDTree(mesh.vertices).query(part)[0] < SAME_POINT_MM)) for part in limits)
