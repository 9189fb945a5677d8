"""Compare two surfaces, masks or label maps, by the measures of the report; what ``cccd compare`` prints.

What is compared is read once, whatever it came in: as a closed mesh in mm RAS, and its voxels where it has
some. A mask's surface is that by which the report measures: marching cubes at one half.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from cccd.api import Surface, read
from cccd.errors import InputError, choices
from cccd.geometry.arrays import BoolArray, FloatArray
from cccd.geometry.distance import to_mesh
from cccd.geometry.mesh import Mesh
from cccd.geometry.raster import dice, voxelise
from cccd.inputs.grid import Volume, interpolate_on_grid, on_grid
from cccd.inputs.labels import plain_name
from cccd.inputs.load import existing
from cccd_labels.label_survey import measure_labels
from cccd_meshes.booleans import shared_volume
from cccd_meshes.closed_meshes import mend
from cccd_meshes.read_meshes import is_mesh, read_mesh
from cccd_workflow.limits import LIMITS, TOLERANCE_MM
from cccd_workflow.surface_measures import SAMPLES, Gaps, normal_angles, normal_figures, voxel_surface


@dataclass(frozen=True)
class _Shape:
    """One side of a row: a surface, and the voxels that it was made of where there are any."""

    label: str
    name: str
    mesh: Mesh
    volume: float | None  # mm^3; None of an open mesh
    voxels: Volume | None = None

    @classmethod
    def of_mesh(cls, mesh: Mesh) -> _Shape:
        closed = is_closed(mesh)
        mesh = mesh.outwards() if closed else mesh
        return cls("", "", mesh, mesh.volume if closed else None)

    @classmethod
    def of_voxels(cls, voxels: Volume, label: str, name: str) -> _Shape:
        size = abs(float(np.linalg.det(voxels.affine[:3, :3])))
        mesh = voxel_surface(voxels.data, voxels.affine, np.zeros(3))
        return cls(label, name, mesh, np.count_nonzero(voxels.data) * size, voxels)


@dataclass(frozen=True)
class Compared:
    """One row of a comparison: one label, or the one organ that both inputs are.

    Attributes
    ----------
    label, name : str
        Of the first input; empty where it has none.
    figures : dict
        What was measured; see `compare`. A figure that a row cannot have is None.
    notes : tuple of str
        What limits the figures, one line each.
    mesh, other : Mesh or None
        The two surfaces, in mm RAS.
    distance : (V,) float64 or None
        Distance in mm from the first mesh's vertices to the second mesh, positive outside it.
    """

    label: str
    name: str
    figures: dict[str, float | None]
    notes: tuple[str, ...] = ()
    mesh: Mesh | None = None
    other: Mesh | None = None
    distance: FloatArray | None = None

    @property
    def caption(self) -> str:
        """Label and name."""
        return " ".join(part for part in (self.label, self.name) if part) or "surface"


@dataclass(frozen=True, repr=False)
class Comparison:
    """Two inputs, row by row."""

    first: str
    second: str
    tolerance_mm: float
    rows: list[Compared]
    notes: list[str] = field(default_factory=list[str])

    def as_json(self) -> dict[str, Any]:
        """Return everything but meshes as plain JSON."""
        return {
            "first": self.first,
            "second": self.second,
            "tolerance_mm": self.tolerance_mm,
            "rows": [
                {"label": row.label, "name": row.name, **row.figures, "notes": list(row.notes)}
                for row in self.rows
            ],
            "notes": self.notes,
        }

    def __repr__(self) -> str:
        """Write a table, and below it the notes."""
        headings = ["", *_HEADINGS.values()]
        shown = [["-" if v is None else f"{v:.4g}" for v in row.figures.values()] for row in self.rows]
        lines = [[row.caption, *values] for row, values in zip(self.rows, shown, strict=True)]
        widths = [max(map(len, column)) for column in zip(headings, *lines, strict=True)]
        table = [
            "  ".join([line[0].ljust(widths[0]), *map(str.rjust, line[1:], widths[1:])])
            for line in (headings, *lines)
        ]
        notes = [f"note: {row.caption}: {note}" for row in self.rows for note in row.notes]
        return "\n".join([*table, *notes, *(f"note: {note}" for note in self.notes)])


#: What figures are called in a table.
_HEADINGS = {
    "dice": "Dice",
    "assd_mm": "ASSD mm",
    "hd95_mm": "HD95 mm",
    "hausdorff_mm": "HD mm",
    "surface_dice": "surface Dice",
    "volume_a_ml": "A ml",
    "volume_b_ml": "B ml",
    "volume_bias": "A/B - 1",
    "normals_median_deg": "normals deg",
    "normals_p90_deg": "p90 deg",
}


def compare(
    first: str | Path | Surface,
    second: str | Path | Surface,
    labels: Sequence[str] = (),
    tolerance_mm: float = TOLERANCE_MM,
    heat_map: bool = False,
) -> Comparison:
    """Compare two inputs, each a surface, a mask or a label map.

    Parameters
    ----------
    first, second : path or Surface
        A mesh (PLY, STL, OBJ, GLB, VTP, GIfTI), ``surface.h5``, a solid (STEP, IGES, BREP), a mask or label
        map (NIfTI, NRRD, MHA), a DICOM SEG or RTSTRUCT, or a folder with a mask per organ.
    labels : sequence of str
        Label to compare, of both inputs, or one of each. Default: every label; two inputs of one label
        each are compared whatever their values are.
    tolerance_mm : float
        Of the surface Dice.
    heat_map : bool
        Whether to measure the distance at every vertex of the first surface.

    Returns
    -------
    Comparison
        Printed as a table. A row's figures are ``dice``, ``assd_mm``, ``hd95_mm``, ``hausdorff_mm``,
        ``surface_dice`` (share of both surfaces within the tolerance), ``volume_a_ml``, ``volume_b_ml``,
        ``volume_bias`` (first over second, less 1), ``normals_median_deg`` and ``normals_p90_deg``. A label
        that one input lacks has a Dice of 0 and no distances.

    Raises
    ------
    InputError
        Not readable, no such label, or no label in common.
    """
    wanted = [*labels, *labels] if len(labels) == 1 else list(labels) or ["", ""]
    notes: list[str] = []
    mine, theirs = (_read(one, label, notes) for one, label in zip((first, second), wanted, strict=True))
    names = [one.name if isinstance(one, Surface) else str(one) for one in (first, second)]
    pairs = _pairs(mine, theirs, (Path(names[0]).name, Path(names[1]).name))
    rows = [_compared(*pair, tolerance_mm, heat_map) for pair in pairs]
    return Comparison(names[0], names[1], tolerance_mm, rows, notes)


def _read(given: str | Path | Surface, label: str, notes: list[str]) -> list[_Shape]:
    """Read every label of an input, or the one that is asked for."""
    if isinstance(given, Surface):
        return [_Shape.of_mesh(given.lofted.mesh)]
    if not isinstance(given, (str, Path)):
        raise InputError("compare", f"{type(given).__name__} is no path or Surface", "give one of them")
    path = existing(Path(given).absolute(), Path(given).name)
    if path.is_file() and is_mesh(path):
        found = read_mesh(path)
        notes += found.notes
        return [_Shape.of_mesh(_closed(found.mesh, path.name, notes))]
    if label:
        structure = read(path, label)
        voxels = Volume(structure.voxels, structure.affine, path.name)
        return [_Shape.of_voxels(voxels, label, "")]
    shapes: list[_Shape] = []
    for surveyed, part in measure_labels(path):
        if part is None:
            notes.append(f"{path.name}: label {surveyed.label}: {surveyed.note}")
        else:
            shapes.append(_Shape.of_voxels(part, surveyed.label, surveyed.name))
    return shapes


def _closed(mesh: Mesh, location: str, notes: list[str]) -> Mesh:
    """Mend a mesh that bounds no volume, and say what was mended; one with wide holes stays as it is."""
    if is_closed(mesh):
        return mesh
    try:
        mended = mend(mesh, location)
    except InputError:
        return mesh
    notes += mended.notes
    return mended.mesh


def _pairs(
    first: list[_Shape], second: list[_Shape], names: tuple[str, str]
) -> list[tuple[_Shape | None, _Shape | None]]:
    """Pair the labels of two inputs: by value, or by name where no value is in both."""
    if len(first) == len(second) == 1:
        return [(first[0], second[0])]
    a, b = names
    for shapes, others, name, other in ((first, second, a, b), (second, first, b, a)):
        if len(shapes) > 1 and not any(shape.label for shape in others):
            raise InputError(
                name,
                f"it contains {len(shapes)} labels, and {other} is one surface",
                f"name one with --label; {_listed(shapes)}",
            )
    for key in (lambda shape: shape.label, _plain):
        mine, theirs = ({key(shape): shape for shape in side} for side in (first, second))
        if mine.keys() & theirs.keys():
            return [(mine.get(one), theirs.get(one)) for one in dict.fromkeys([*mine, *theirs])]
    raise InputError(
        f"{a}, {b}",
        f"no label in common ({_listed(first)}; {_listed(second)})",
        "name one of each: --label A --label B",
    )


def _plain(shape: _Shape) -> str:
    return plain_name(shape.name or shape.label).lower()


def _listed(shapes: Sequence[_Shape]) -> str:
    return choices(shape.name or shape.label for shape in shapes)


def _compared(first: _Shape | None, second: _Shape | None, tolerance: float, heat_map: bool) -> Compared:
    figures: dict[str, float | None] = dict.fromkeys(_HEADINGS)
    for shape, name in ((first, "volume_a_ml"), (second, "volume_b_ml")):
        if shape is not None and shape.volume is not None:
            figures[name] = shape.volume / 1000
    there = [shape for shape in (first, second) if shape is not None]
    label, name = (
        next(filter(None, words), "") for words in zip(*((s.label, s.name) for s in there), strict=True)
    )
    row = Compared(label, name, figures)
    if first is None or second is None:
        figures |= {"dice": 0.0, "surface_dice": 0.0}
        only = "second" if first is None else "first"
        return replace(row, notes=(f"only the {only} input has it",))
    gaps = Gaps.between(first.mesh, second.mesh, np.random.default_rng(0), SAMPLES)
    figures |= {f"{name}_mm": value for name, value in gaps.figures.items()}
    figures |= {"dice": _dice(first, second), "surface_dice": gaps.surface_dice(tolerance)}
    angles = normal_angles(first.mesh, second.mesh, np.random.default_rng(0), is_smooth=False)
    figures |= normal_figures(angles)
    if first.volume is not None and second.volume:
        figures["volume_bias"] = first.volume / second.volume - 1
    distance = None
    if heat_map:
        distance = to_mesh(first.mesh.vertices, second.mesh)
        distance = np.abs(distance) if second.volume is None else distance
    return replace(row, notes=_notes(first, second), mesh=first.mesh, other=second.mesh, distance=distance)


def _notes(first: _Shape, second: _Shape) -> tuple[str, ...]:
    """Say what limits the figures of a row."""
    notes: list[str] = []
    for shape, which in ((first, "first"), (second, "second")):
        if shape.volume is None:
            notes.append(f"the {which} surface is open: no volume and no Dice")
    if not _overlap(first.mesh.vertices, second.mesh.vertices):
        flipped = _overlap(first.mesh.vertices * (-1, -1, 1), second.mesh.vertices)
        hint = "one is probably in LPS, the other in RAS" if flipped else "check that both are in mm RAS"
        notes.append(f"the two do not overlap: {hint}")
    return tuple(notes)


def _overlap(points: FloatArray, others: FloatArray) -> bool:
    """Whether the boxes around points (P, 3) and (Q, 3) overlap."""
    low = np.maximum(points.min(axis=0), others.min(axis=0))
    return bool(np.all(low <= np.minimum(points.max(axis=0), others.max(axis=0))))


def _dice(first: _Shape, second: _Shape) -> float | None:
    """Dice on the finer grid of the two, or of the solids where neither has a grid; None of open surfaces."""
    if first.volume is None or second.volume is None:
        return None
    gridded = [shape for shape in (first, second) if shape.voxels is not None]
    if not gridded:
        return solid_dice(first.mesh, second.mesh)
    finest = min(gridded, key=lambda shape: abs(np.linalg.det(_voxels(shape).affine[:3, :3])))
    affine, size = _block(_voxels(finest).affine, (first.mesh, second.mesh))
    return float(dice(_on_block(first, affine, size), _on_block(second, affine, size)))


def _voxels(shape: _Shape) -> Volume:
    assert shape.voxels is not None
    return shape.voxels


def _block(affine: FloatArray, meshes: Sequence[Mesh]) -> tuple[FloatArray, tuple[int, int, int]]:
    """Block of a grid around meshes: its own affine (4, 4), and its shape."""
    points = np.concatenate([mesh.vertices for mesh in meshes])
    index = np.linalg.solve(affine[:3, :3], (points - affine[:3, 3]).T)
    low, high = np.floor(index.min(axis=1)).astype(int) - 1, np.ceil(index.max(axis=1)).astype(int) + 1
    moved = affine.copy()
    moved[:3, 3] += affine[:3, :3] @ low
    a, b, c = (int(size) for size in high - low + 1)
    return moved, (a, b, c)


def _on_block(shape: _Shape, affine: FloatArray, size: tuple[int, int, int]) -> BoolArray:
    """Voxels (a, b, c) of a block that a shape holds."""
    if shape.voxels is None:
        return voxelise(shape.mesh, affine, size)
    moved = on_grid(shape.voxels, affine, size, fill=False)
    if moved is None:
        ringed = shape.voxels.affine.copy()  # with background all round, which goes on beyond
        ringed[:3, 3] -= ringed[:3, :3].sum(axis=1)
        padded = replace(shape.voxels, data=np.pad(shape.voxels.data, 1), affine=ringed)
        moved = interpolate_on_grid(padded, affine, size, order=0)
    return np.asarray(moved.data, bool)


def missed_limits(found: Comparison, limits: Mapping[str, float]) -> list[str]:
    """List which rows miss which limits; a figure that a row does not have misses its limit.

    Parameters
    ----------
    found : Comparison
    limits : mapping of str to float
        By figure, see `cccd_workflow.limits.LIMITS`.
    """
    missed: list[str] = []
    for row in found.rows:
        for figure, limit in limits.items():
            value, known = row.figures[figure], LIMITS[figure]
            if known.is_missed(value, limit):
                side = "below" if known.option.startswith("min") else "above"
                is_ = f"no {known.name}, limit" if value is None else f"{known.name} {value:.4g} is {side}"
                missed.append(f"{row.caption}: {is_} {limit:g}")
    return missed


def solid_dice(first: Mesh, second: Mesh) -> float | None:
    """Dice of what two closed meshes enclose, exact; None where one of them bounds no solid."""
    shared = shared_volume(first, second)
    return None if shared is None else min(1.0, 2 * shared / (first.volume + second.volume))


def is_closed(mesh: Mesh) -> bool:
    """Whether faces run along every edge as often one way as the other: the mesh bounds a volume."""
    if len(mesh.faces) == 0:
        return False
    count = int(mesh.faces.max()) + 1
    start, end = mesh.faces.ravel(), np.roll(mesh.faces, -1, axis=1).ravel()
    return np.array_equal(np.sort(start * count + end), np.sort(end * count + start))
