"""How far two readers' borders of the same organs lie apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from cccd.bands import SHARES, Calibration, Reader, estimate_band
from cccd.containers import Structure
from cccd.contours import trace_contours
from cccd.errors import InputError
from cccd.geometry.arrays import FloatArray
from cccd.geometry.mesh import Mesh
from cccd.settings.root import Settings
from cccd.surface.loft import loft_in_plane
from cccd.surface.spline import SplineSolid
from cccd_calibration.conformal import coverage_curve, smallest_factor, too_few_organs
from cccd_calibration.thinning import sample_offsets
from cccd_workflow.sheet import read_rows


@dataclass(frozen=True, eq=False)
class Pair:
    """Two readers' borders of one organ.

    Attributes
    ----------
    organ : str
        Pairs of one organ count as one.
    beyond : (len(SHARES), N) float64
        What a width must be, in mm, for the second reader's border to lie within the first one's band.
    swept : (len(SHARES),) float64
        The same for the volume.
    """

    organ: str
    beyond: FloatArray
    swept: FloatArray


class PairRow(NamedTuple):
    """A row of a table of pairs: where it is, the organ's name, two masks, and their label."""

    where: str
    name: str
    first: str
    second: str
    label: str


def read_pairs(path: Path) -> list[PairRow]:
    """Read a table of masks of the same organs by two readers.

    Parameters
    ----------
    path : Path
        Tab-separated, with columns ``first`` and ``second``, and if wanted ``organ`` (pairs of one organ
        count as one; default: the first mask) and ``label``.

    Raises
    ------
    InputError
        Names file and row.
    """
    found: list[PairRow] = []
    for where, row in read_rows(path, "table of pairs", "name a .tsv file")[2]:
        first, second = row.get("first") or "", row.get("second") or ""
        for name in (first, second):
            if not name or not (path.parent / name).exists():
                problem = f"there is no mask {name}" if name else "a pair needs two masks"
                hint = "give columns first and second: two masks of one organ, relative to the table"
                raise InputError(where, problem, hint)
        found.append(PairRow(where, row.get("organ") or first, first, second, row.get("label") or ""))
    if not found:
        raise InputError(path.name, "the table has no rows", "give columns first and second")
    return found


def calibrate_readers(pairs: Sequence[Pair], share: float, location: str) -> Reader:
    """Find the smallest widths within which another reader's border lies.

    Parameters
    ----------
    pairs : sequence of Pair
    share : float
        That there must be organs enough for.
    location : str
        What messages name.

    Raises
    ------
    InputError
        There are too few organs.
    """
    names = [pair.organ for pair in pairs]
    found: list[tuple[float, float]] = []
    for number, one in enumerate(SHARES):
        curves = np.array([coverage_curve(pair.beyond[number]) for pair in pairs])
        volumes = np.array([coverage_curve(pair.swept[number : number + 1]) for pair in pairs])
        width, swept = (smallest_factor(of, names, one) for of in (curves, volumes))
        if width is None or swept is None:
            break
        found.append((width, swept))
    if len(found) <= np.searchsorted(SHARES, share):
        raise too_few_organs(location, len(set(names)), share)
    widths, swept = zip(*found, strict=True)
    return Reader(widths, swept, f"{len(pairs)} pairs of readers, {len(set(names))} organs of {location}")


def compare_readers(first: Structure, second: Structure, settings: Settings, name: str) -> Pair:
    """Loft one reader's border, and find how much wider its band must be to hold the second reader's.

    Parameters
    ----------
    first, second : Structure
        One organ on one grid.
    settings : Settings
    name : str
        What messages name.

    Raises
    ------
    InputError
        The two are not on the same grid.
    """
    if first.frame.shape != second.frame.shape or not np.allclose(first.frame.affine, second.frame.affine):
        raise InputError(name, "the two masks are not on the same grid", "give masks of one scan")
    (solid, mesh), (_, other) = (_lofted(structure, settings) for structure in (first, second))
    slices, known = solid.stack.slices, Calibration.read(settings.surface.calibration)
    rows, offset = sample_offsets(mesh, other, np.random.default_rng(settings.seed))
    swept, beyond, volumes = abs(other.volume - mesh.volume) / mesh.area, list[FloatArray](), list[float]()
    for share in SHARES:
        band = estimate_band(solid.mesh, slices, share, known)
        beyond.append(np.sqrt(np.maximum(offset**2 - band.outer[rows] ** 2, 0)))
        held = band.volume_factor * float(mesh.vertex_areas @ band.outer) / mesh.area
        volumes.append(float(np.sqrt(max(swept**2 - held**2, 0))))
    return Pair(name, np.array(beyond), np.array(volumes))


def _lofted(structure: Structure, settings: Settings) -> tuple[SplineSolid, Mesh]:
    """Loft a mask: in the plane, and in mm RAS."""
    sections = structure.sections(trace_contours(structure))
    solid = loft_in_plane(sections, settings.surface)
    return solid, solid.mesh.transformed(solid.stack.to_world).outwards()
