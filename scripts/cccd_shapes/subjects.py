"""The cohort: a sheet with a row for each subject, and the closed surface of each."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path

import numpy as np

from cccd.bands import Band
from cccd.containers import Frame
from cccd.errors import InputError
from cccd.geometry.mesh import Mesh
from cccd.store import read_band, read_report, read_surface_frame
from cccd.surface.surface import read_surface, write_files
from cccd_meshes.closed_meshes import read_closed_mesh
from cccd_meshes.read_meshes import is_mesh
from cccd_shapes import FEWEST
from cccd_workflow.sheet import read_rows

#: Columns that a sheet may have.
COLUMNS = ("name", "surface", "mask", "label", "mirrored", "group", "time")
#: What is said in the column ``mirrored``.
YES, NO = ("yes", "true", "1"), ("", "no", "false", "0")
#: Reflects x: a left organ lies as a right one.
MIRROR = np.diag([-1.0, 1.0, 1.0, 1.0])
#: Largest root mean square distance of a fitted surface to the subject's own, in pixels.
TOLERANCE_PIXELS = 0.5


@dataclass(frozen=True)
class Row:
    """A row of the sheet."""

    where: str  # file and row, for messages
    name: str
    path: Path  # of a surface, or of a mask
    label: str | None  # of the mask; None for a surface
    mirrored: bool  # whether the subject is reflected in x before it is compared
    group: str
    time: float | None = None  # of a frame of a series


@dataclass(frozen=True, eq=False)
class Subject:
    """A subject's surface."""

    row: Row
    mesh: Mesh  # closed, oriented outwards, in mm RAS, reflected if the row says so
    pixel: float  # edge of a pixel in mm: of the scan, or of a mesh without one the median edge
    tolerance: float  # largest distance in mm (rms) of a fit to ``mesh``
    notes: tuple[str, ...] = ()  # what was mended, one line each
    band: Band | None = None  # how far ``mesh`` may be off, where that is known

    @property
    def name(self) -> str:
        """The subject's name."""
        return self.row.name

    @property
    def frame(self) -> Frame:
        """A grid of the scan's pixels."""
        return Frame(np.diag([self.pixel, self.pixel, self.pixel, 1.0]), 2, (1, 1, 1))


def read_sheet(path: str | Path) -> list[Row]:
    """Read a sheet of subjects: tab-separated, with a header.

    Parameters
    ----------
    path : path
        Columns: ``name``, and ``surface`` or ``mask``; optionally ``label`` of the mask, ``mirrored`` (yes or
        no), ``group`` and ``time``. Paths are relative to the sheet.

    Raises
    ------
    InputError
        A column is unknown, or a row does not name one file that is there.
    """
    path = Path(path)
    _, header, lines = read_rows(path, "sheet", "give a tab-separated file")
    for column in header:
        if column not in COLUMNS:
            raise InputError(path.name, f"unknown column {column!r}", f"columns are {', '.join(COLUMNS)}")
    if "name" not in header or not {"surface", "mask"} & set(header):
        raise InputError(path.name, "columns are missing", "give name, and surface or mask, between tabs")
    rows = [_row(path.parent, where, line) for where, line in lines]
    names = [row.name for row in rows]
    for row in rows:
        if names.count(row.name) > 1:
            raise InputError(row.where, f"the name {row.name!r} is there twice", "give each its own name")
    timeless = [row.where for row in rows if row.time is None]
    if 0 < len(timeless) < len(rows):
        raise InputError(timeless[0], "it has no time, others have", "give all rows a time, or none")
    if len(rows) < FEWEST:
        raise InputError(path.name, f"it has fewer than {FEWEST} subjects", "add rows")
    return rows


def _row(folder: Path, where: str, line: Mapping[str, str]) -> Row:
    """Check one line of the sheet."""
    cells = {name: line.get(name, "") for name in COLUMNS}
    name, surface, mask, time = (cells[column] for column in ("name", "surface", "mask", "time"))
    path, mirrored = folder / (surface or mask), cells["mirrored"].lower()
    written = re.fullmatch(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?", time or "0")
    at = float(time or 0) if written else np.nan
    for wrong, problem, hint in (
        (not re.fullmatch(r"[A-Za-z0-9_-]+", name), f"name {name!r}", "use letters, digits, - and _"),
        (bool(surface) == bool(mask), "it needs one of surface and mask", "fill one of the two columns"),
        (not path.exists(), f"{path}: there is no such file", "correct the path"),
        (surface and not is_mesh(path), f"{path.name} is not a surface", "put masks into the column mask"),
        (mirrored not in (*YES, *NO), f"mirrored is {cells['mirrored']!r}", "write yes or no"),
        (not np.isfinite(at), f"time is {time!r}", "write a number"),
    ):
        if wrong:
            raise InputError(where, problem, hint)
    label = cells["label"] if mask else None
    return Row(where, name, path, label, mirrored in YES, cells["group"], at if time else None)


def fingerprint(*parts: object) -> str:
    """Return a short text that changes with what it is made of."""
    made = hashlib.sha256()
    for part in parts:
        made.update(part.tobytes() if isinstance(part, np.ndarray) else repr(part).encode())
    return made.hexdigest()[:20]


def read_subject(row: Row, folder: Path, tolerance: float | None = None) -> Subject:
    """Read a subject's surface.

    Parameters
    ----------
    row : Row
        Of the sheet.
    folder : path
        The surface of a mask is made, and kept there for the next time.
    tolerance : float, optional
        Largest distance of a fit to the surface, in mm (rms); default: half a pixel.

    Returns
    -------
    Subject
        Of several pieces the largest alone, with a note.

    Raises
    ------
    InputError
        The file is not readable, or the surface is open.
    """
    try:
        if row.label is None:
            mended, path = read_closed_mesh(row.path), row.path
            mesh, notes = mended.mesh, mended.notes
        else:
            path, mesh, notes = _surface_of_mask(row, folder)
    except InputError as error:
        raise error.at(row.where) from None
    mesh, left_out = _largest(mesh)
    band, pixel = None, float(np.median(mesh.to_trimesh().edges_unique_length))
    if path.suffix == ".h5":
        band, pixel = read_band(path, mesh.vertices), float(min(read_surface_frame(path).spacing))
    mesh = mesh.transformed(MIRROR) if row.mirrored else mesh
    return Subject(row, mesh, pixel, tolerance or TOLERANCE_PIXELS * pixel, (*notes, *left_out), band)


def read_surfaces(files: Sequence[str | Path], groups: Sequence[str] = ()) -> list[Subject]:
    """Read the workflow's surfaces ``CASE/ORGAN/surface.h5``: a subject for each case, of such groups."""
    rows = [
        Row(str(file), Path(file).parent.parent.name, Path(file), None, False, group)
        for file, group in zip_longest(files, groups, fillvalue="")
    ]
    return [read_subject(row, row.path.parent) for row in rows]


def _largest(mesh: Mesh) -> tuple[Mesh, tuple[str, ...]]:
    """Return the largest of a mesh's pieces, and a line where there are others."""
    pieces = sorted(mesh.pieces(), key=lambda piece: -piece.volume)
    lost = sum(piece.volume for piece in pieces[1:]) / 1000
    note = f"left out all but the largest of {len(pieces)} pieces ({lost:.3g} ml)"
    return (pieces[0], (note,)) if len(pieces) > 1 else (mesh, ())


def _surface_of_mask(row: Row, folder: Path) -> tuple[Path, Mesh, tuple[str, ...]]:
    """File, mesh and warnings of a mask's surface, made as ``cccd surface`` does."""
    import cccd

    path, mesh_path = folder / f"{row.name}.h5", folder / f"{row.name}.ply"
    files = sorted(row.path.rglob("*")) if row.path.is_dir() else [row.path]
    state = [(file.name, file.stat().st_size, file.stat().st_mtime_ns) for file in files]
    made_of = fingerprint(cccd.__version__, state, row.label)
    if not (path.is_file() and mesh_path.is_file() and read_report(path).get("made_of") == made_of):
        surface = cccd.reconstruct(cccd.read(row.path, row.label or ""))
        lofted = surface.lofted
        lofted.report |= {"made_of": made_of, "warnings": list(surface.warnings)}
        write_files(lofted, path, mesh_path)
    kept = read_surface(path, mesh_path)
    return path, kept.mesh, tuple(kept.report["warnings"])
