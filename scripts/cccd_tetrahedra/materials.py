"""Grey values of a scan in tetrahedra, and the elastic materials that a table makes of them."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from scipy import ndimage
from scipy.special import roots_jacobi

from cccd.errors import InputError
from cccd.geometry.arrays import FloatArray
from cccd.inputs.grid import Volume
from cccd_tetrahedra.filling import Materials, TetrahedralMesh

#: Points along an edge at which the scan is sampled, at most: 512 in a tetrahedron.
MOST_ALONG = 8

#: Materials at most: in bone of 10 to 20,000 MPa, within some 15 % of a tetrahedron's own modulus.
MOST_MATERIALS = 30

#: Tetrahedra that are sampled at once, times the points in each.
_AT_ONCE = 2_000_000

#: Points lie in the scan when they are this near to it, in voxels: faces are chords of the surface.
_NEAR_VOXELS = 1.0

_REQUIRED = ("hu_from", "hu_to", "density", "young_mpa", "poisson")


@dataclass(frozen=True)
class Row:
    """What tissue is from one grey value to another: density = a + b HU, modulus = E density^n.

    Attributes
    ----------
    hu_from, hu_to : float
        From the first, up to but without the second; infinite where the table has nothing.
    density, density_per_hu : float
        g/cm^3, and g/cm^3 per unit of grey.
    young_mpa, young_power : float
        Young's modulus in MPa at a density of 1 g/cm^3, and the power of the density; 0: it is constant.
    poisson : float
    """

    hu_from: float
    hu_to: float
    density: float
    young_mpa: float
    poisson: float
    density_per_hu: float = 0.0
    young_power: float = 0.0


def read_table(path: str | Path) -> list[Row]:
    """Read a table of materials: CSV with the columns hu_from, hu_to, density, young_mpa and poisson.

    Columns density_per_hu and young_power are optional; an empty hu_from or hu_to has no bound.

    Parameters
    ----------
    path : path

    Returns
    -------
    list of Row
        Ascending, each beginning where the one before ends.

    Raises
    ------
    InputError
        Missing, not such a table, or with gaps, overlaps or numbers that no material has.

    Examples
    --------
    >>> import tempfile
    >>> path = Path(tempfile.mkdtemp(), "bone.csv")
    >>> with path.open("w") as file:
    ...     for row in ("hu_from,hu_to,density,young_mpa,poisson", ",200,.3,500,.3", "250,,1.8,17e3,.3"):
    ...         print(row, file=file)
    >>> read_table(path)
    Traceback (most recent call last):
    cccd.errors.InputError: bone.csv row 2: it begins at 250 HU, but row 1 ends at 200; let rows meet
    """
    path = Path(path)
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            lines = [line for line in csv.DictReader(file, skipinitialspace=True) if any(line.values())]
    except FileNotFoundError:
        raise InputError(str(path), "there is no such table of materials", "check the path") from None
    except (UnicodeDecodeError, csv.Error, IsADirectoryError):
        raise InputError(str(path), "it is not a table in text", "save it as CSV, UTF-8") from None
    known = [field.name for field in fields(Row)]
    columns = [name for name in (lines[0] if lines else {}) if name]
    missing = [name for name in _REQUIRED if name not in columns]
    if missing:
        hint = f"the first line names the columns: {','.join(known)}"
        raise InputError(path.name, f"it has no column {missing[0]}", hint)
    unknown = [name for name in columns if name not in known]
    if unknown:
        raise InputError(path.name, f"column {unknown[0]} is not known", f"columns are {', '.join(known)}")
    rows = [_row(line, f"{path.name} row {n}") for n, line in enumerate(lines, 1)]
    for n, (before, row) in enumerate(pairwise(rows), 2):
        if row.hu_from != before.hu_to:
            problem = f"it begins at {row.hu_from:g} HU, but row {n - 1} ends at {before.hu_to:g}"
            hint = "let rows meet" if row.hu_from > before.hu_to else "let rows ascend and not overlap"
            raise InputError(f"{path.name} row {n}", problem, hint)
    return rows


def _row(line: Mapping[str, Any], location: str) -> Row:
    values: dict[str, float] = {}
    for name, text in line.items():
        if text is None or not str(text).strip():
            if name not in _REQUIRED:
                continue
            text = {"hu_from": "-inf", "hu_to": "inf"}.get(name, "")
        try:
            values[name] = float(text)
        except (TypeError, ValueError):
            raise InputError(location, f"{name} is {text!r}", "give a number") from None
    row = Row(**values)
    if not row.hu_from < row.hu_to:
        raise InputError(location, f"it goes from {row.hu_from:g} to {row.hu_to:g} HU", "let it ascend")
    if not row.young_mpa > 0:
        raise InputError(location, f"young_mpa is {row.young_mpa:g}", "give a positive modulus in MPa")
    if not -1 < row.poisson < 0.5:
        raise InputError(location, f"poisson is {row.poisson:g}", "give a number above -1 and below 0.5")
    return row


def mean_grey_values(corners: FloatArray, scan: Volume) -> FloatArray:
    """Mean grey value (N,) in tetrahedra (N, 4, 3), in mm: linear between voxels, at Gauss points.

    As many points lie along an edge as there are voxels, up to `MOST_ALONG`: the mean of a scan that is
    linear is exact.

    Raises
    ------
    InputError
        Tetrahedra lie outside the scan.

    Examples
    --------
    >>> scan = Volume(np.arange(8.0).reshape(2, 2, 2), np.eye(4), "scan.nii.gz")
    >>> corner = np.array([(0.0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)])
    >>> mean_grey_values(corner[None], scan).round(6).tolist()  # 4 x + 2 y + z at the centroid
    [1.75]
    """
    inverse = np.linalg.inv(scan.affine)
    index = corners @ inverse[:3, :3].T + inverse[:3, 3]
    outside = (index < -0.5 - _NEAR_VOXELS) | (index > np.array(scan.shape) - 0.5 + _NEAR_VOXELS)
    count = int(outside.any(axis=(1, 2)).sum())
    if count:
        problem = f"{count} of {len(index)} tetrahedra lie outside the scan"
        raise InputError(scan.location, problem, "give the scan that the mask was drawn on, uncropped")
    longest = np.max(np.linalg.norm(index[:, :, None] - index[:, None], axis=-1), axis=(1, 2))
    along = np.clip(np.ceil(longest), 1, MOST_ALONG).astype(int)
    values = np.asarray(scan.data, np.float32)
    found = np.empty(len(index))
    for n in np.unique(along):
        barycentric, weights = _gauss_points(int(n))
        own = np.flatnonzero(along == n)
        for part in np.array_split(own, max(1, len(own) * len(weights) // _AT_ONCE)):
            points = np.einsum("pk,nkc->cnp", barycentric, index[part])
            sampled = ndimage.map_coordinates(values, points, order=1, mode="nearest")
            found[part] = sampled @ weights
    return found


def _gauss_points(n: int) -> tuple[FloatArray, FloatArray]:
    """Barycentric points (n^3, 4) in a tetrahedron and weights (n^3,): Gauss's of a collapsed cube."""
    rules = [roots_jacobi(n, power, 0) for power in (2, 1, 0)]
    (a, wa), (b, wb), (c, wc) = [((1 + x) / 2, w / w.sum()) for x, w in rules]
    a, b, c = (x.ravel() for x in np.meshgrid(a, b, c, indexing="ij"))
    weights = (wa[:, None, None] * wb[:, None] * wc).ravel()
    y, z = (1 - a) * b, (1 - a) * (1 - b) * c
    return np.column_stack([a, y, z, 1 - a - y - z]), weights


def bin_materials(
    grey: FloatArray, weights: FloatArray, rows: Sequence[Row], most: int, location: str
) -> tuple[Materials, float]:
    """Make at most so many materials of grey values.

    Parameters
    ----------
    grey, weights : (N,) float64
        Mean grey value and volume of each tetrahedron.
    rows : sequence of Row
    most : int
        Materials are equally far apart in the logarithm of their moduli.
    location : str
        The table's name, for messages.

    Returns
    -------
    Materials
        Moduli, densities and ratios are the means of the tetrahedra that have the material.
    float
        How far, at most, the modulus of a material is off that of one of its tetrahedra: 0.05 is 5 %.

    Raises
    ------
    InputError
        Grey values lie outside the table, or its law gives a density or modulus that is not positive.
    """
    ends = np.array([rows[0].hu_from, *(row.hu_to for row in rows)])
    outside = (grey < ends[0]) | (grey >= ends[-1])
    if outside.any():
        end = "hu_from of the first row" if grey.min() < ends[0] else "hu_to of the last row"
        problem = (
            f"{int(outside.sum())} tetrahedra are outside it, with {grey.min():.0f} to {grey.max():.0f} HU"
        )
        raise InputError(location, problem, f"widen {end}, or leave it empty")
    which = np.searchsorted(ends[1:-1], grey, side="right")
    table = {name: np.array([getattr(row, name) for row in rows])[which] for name in Row.__annotations__}
    density = table["density"] + table["density_per_hu"] * grey
    if density.min() <= 0:
        worst = int(density.argmin())
        problem = f"the density is {density[worst]:.3g} g/cm3 at {grey[worst]:.0f} HU"
        raise InputError(
            f"{location} row {which[worst] + 1}", problem, "give low grey values a row of their own"
        )
    young = table["young_mpa"] * density ** table["young_power"]
    poisson = table["poisson"]
    kinds, number = np.unique(np.column_stack([young, density, poisson]), axis=0, return_inverse=True)
    number = number.reshape(-1)
    if len(kinds) > most:
        logs = np.log(young)
        width = np.ptp(logs) / most
        place = np.zeros(len(logs), np.int64) if width == 0 else np.floor((logs - logs.min()) / width)
        _, number = np.unique(np.minimum(place, most - 1), return_inverse=True)
    share = np.bincount(number, weights)
    means = [np.bincount(number, weights * of) / share for of in (density, young, poisson)]
    off = float(np.abs(means[1][number] / young - 1).max())
    return Materials(number, *means), off


def check_materials(table: str, names: Iterable[str], scans: Mapping[str, Volume]) -> list[Row]:
    """Read a table of materials for organs, before their tetrahedra are made.

    Raises
    ------
    InputError
        An organ has no scan, or see `read_table`.
    """
    for name in names:
        if name not in scans:
            hint = "name it (--image ct.nii.gz; column image), or leave surface.tetrahedra.materials out"
            raise InputError(name, "materials need the grey values of its scan, and there is none", hint)
    return read_table(table)


def assign_materials(
    filled: TetrahedralMesh, scans: Mapping[str, Volume], rows: Sequence[Row] | None, table: str = ""
) -> tuple[TetrahedralMesh, dict[str, Any]]:
    """Give tetrahedra the grey values of their organ's scan, and materials where there is a table.

    Parameters
    ----------
    filled : TetrahedralMesh
    scans : mapping of str to Volume
        Each organ's scan.
    rows : sequence of Row or None
        See `read_table`.
    table : str
        The table's name, for messages.

    Returns
    -------
    TetrahedralMesh
        With ``grey`` and, with a table, ``materials``.
    dict
        Plain JSON: of each organ ``grey`` (least, mean, largest); with a table ``materials`` (their number),
        ``young_mpa`` (least, largest) and ``young_error`` (see `bin_materials`).

    Raises
    ------
    InputError
        See `mean_grey_values`, `bin_materials`.
    """
    corners = filled.vertices[filled.tetrahedra]
    grey = np.empty(len(corners))
    report: dict[str, Any] = {"grey": {}}
    for n, name in enumerate(filled.names):
        own = filled.regions == n
        grey[own] = mean_grey_values(corners[own], scans[name])
        mean = float(np.average(grey[own], weights=filled.volumes[own]))
        report["grey"][name] = [float(grey[own].min()), mean, float(grey[own].max())]
    if rows is None:
        return replace(filled, grey=grey), report
    materials, off = bin_materials(grey, filled.volumes, rows, MOST_MATERIALS, table)
    young = [float(materials.young.min()), float(materials.young.max())]
    report |= {"materials": len(materials.young), "young_mpa": young, "young_error": off}
    return replace(filled, grey=grey, materials=materials), report
