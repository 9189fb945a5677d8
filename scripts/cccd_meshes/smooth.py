"""A smooth closed surface of a mesh, a solid, or contours in planes of several directions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from cccd.api import Surface, checked_settings, one_thread, reconstruct_structure
from cccd.extras import needing
from cccd.inputs.file_requests import name_of
from cccd.inputs.load import existing, frame_of
from cccd.inputs.row_files import read_image
from cccd.settings.root import Settings
from cccd.surface.surface import LoftedSurface
from cccd_meshes.closed_meshes import (
    check_overlap,
    drawn_planes,
    read_closed_mesh,
    structure_of_mesh,
    structure_of_planes,
)


@needing("cccd.smooth_mesh")
@one_thread
def smooth_mesh(
    path: str | Path,
    like: str | Path | None = None,
    *,
    label: str = "",
    settings: Settings | None = None,
    progress: Callable[[str], None] | None = None,
) -> Surface:
    """Make a smooth closed surface of a mesh, a solid, or contours in planes of several directions.

    Parameters
    ----------
    path : path
        PLY, STL, OBJ, GLB, VTP, GIfTI, ``surface.h5``, STEP, IGES or BREP, in mm RAS. Contours: CSL, or an
        RTSTRUCT drawn in planes of several directions.
    like : path, optional
        A scan or the folder of a DICOM series: label maps, SEG and RTSTRUCT that are written lie on its grid,
        and hold the mesh as it was given.
    label : str
        Number or name of an RTSTRUCT's ROI.
    settings, progress
        See `reconstruct`.

    Returns
    -------
    Surface
        What was mended is among its warnings.

    Raises
    ------
    InputError
        Not readable, open, or not where the scan is.

    See Also
    --------
    reconstruct : of voxels and contours.
    """
    settings, path = checked_settings(settings), Path(path)
    tell = progress or (lambda step: None)
    tell("contours")
    planes = drawn_planes(existing(path.absolute(), path.name), label)
    if planes is None:
        structure = structure_of_mesh(read_closed_mesh(path), name_of(path))
    else:
        structure = structure_of_planes(planes, name_of(path))
    given, series, scan = None, None, None
    if like is not None:
        source = existing(Path(like).absolute(), Path(like).name)
        scan = read_image(source, "files", settings.import_.fill_gaps)
        grid = frame_of(scan, settings.import_)
        if structure.truth is not None:
            check_overlap(structure.truth, scan, path.name)
            given = LoftedSurface([], structure.truth, grid)
        series = source if source.is_dir() else None
    surface = reconstruct_structure(structure, settings, tell)
    lofted = replace(surface.lofted, band=None)  # that is of organs in scans
    return replace(surface, lofted=lofted, series=series, drawn=None, given=given, scan=scan)
