"""The stack of slices as signed distances, on the slices and on levels between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy import ndimage

from cccd.bands import Slices
from cccd.containers import Annotation, Frame, Sections
from cccd.geometry.arrays import BoolArray, FloatArray, IntArray, RealArray, SingleArray
from cccd.geometry.mesh import Mesh
from cccd.settings.surface import LoftSettings
from cccd.surface.distances import Borders, SampledDistance, find_borders
from cccd.surface.levels import levels_of_slices
from cccd.surface.moving_branches import SAME_HEIGHT, move_branches

#: Bytes of a control point (three float32), of a mesh vertex and of a triangle in binary PLY.
CONTROL_BYTES, VERTEX_BYTES, TRIANGLE_BYTES = 12, 12, 13
#: What the scan cuts runs on for so many pixels, as far as meshes are smoothed; a plane cuts it then.
RUN_ON_PIXELS = 12.0


@dataclass(frozen=True, eq=False)
class SliceStack:
    """What the slices hold, in the plane's mm and height, and the sizes that it is measured by.

    Attributes
    ----------
    slices : Slices
        The signed distances on the slices alone, within their planes.
    distance : SampledDistance
        Those in space, on the slices and on levels between them.
    origin : (2,) int64
        Source ``(i, j)`` of the plane's first pixel.
    to_world : (4, 4) float64
        Affine from the plane's mm and height in mm to mm RAS.
    voxel : (3,) float64
        Distance between slices, and a pixel's edges along i and j, in mm.
    voxel_faces : (3,) int64
        Faces between voxels inside and outside, square to each of these.
    volume : float
        What the slices enclose in mm^3.
    of_some_slices : bool
        Whether only some slices were drawn: ``volume`` then is an estimate.
    smallest : float
        Parts of fewer mm^3 are left out.
    smallest_voxels : float
        The same in voxels, as it was asked for.
    left_out : dict of str to list of float
        Volumes in mm^3 of each ``fragment`` that was, and of each ``cavity`` that was filled.
    warnings : tuple of str
        What a user should know of what lies between the slices.
    """

    slices: Slices
    distance: SampledDistance
    origin: IntArray
    to_world: FloatArray
    voxel: FloatArray
    voxel_faces: IntArray
    volume: float
    of_some_slices: bool
    smallest: float
    smallest_voxels: float
    left_out: dict[str, list[float]]
    warnings: tuple[str, ...] = ()

    @property
    def held_volume(self) -> float | None:
        """The mm^3 that a surface must hold; None where the slices only tell about how much."""
        return None if self.of_some_slices else self.volume

    @property
    def step(self) -> float:
        """Distance between slices in mm."""
        return float(self.voxel[0])

    @property
    def pixel(self) -> float:
        """Edge length of a pixel in mm (the geometric mean of its two)."""
        return self.slices.pixel

    @cached_property
    def part_volumes(self) -> list[float]:
        """Volumes in mm^3 of the slices' parts; voxels that touch at a corner are of one part."""
        _, sizes = label_parts(self.slices.distance < 0, self.slices.z, self.step)
        return (sizes * float(self.voxel.prod())).tolist()

    @property
    def marching_cubes_bytes(self) -> int:
        """Size of marching cubes' mesh of the slices in binary PLY."""
        return int(self.voxel_faces.sum()) * (VERTEX_BYTES + 2 * TRIANGLE_BYTES)


@dataclass(frozen=True)
class _Ends:
    """Where the scan ends, in mm of height.

    Attributes
    ----------
    first, last : float
        Its first and last slice: an organ that reaches them was cut by the scan.
    low, high : float
        Its faces, where the file's own grid has them.
    half : float
        Half the distance of the scan's slices: how far what it cuts reaches beyond its last slice.
    """

    first: float
    last: float
    low: float
    high: float
    half: float

    @classmethod
    def of(cls, frame: Frame, step: float, annotation: Annotation | None) -> _Ends:
        """Find them; ``step`` mm are between the slices that are known."""
        last = (frame.shape[frame.slice_axis] - 1) * frame.slice_spacing
        return cls(0.0, last, *frame.ends, (step if annotation is None else frame.slice_spacing) / 2)

    def cut(self, z: FloatArray) -> tuple[bool, bool]:
        """Whether slices at heights (S,) begin, and end, where the scan does."""
        return bool(abs(z[0] - self.first) < self.half), bool(abs(z[-1] - self.last) < self.half)

    def heights(self, z: FloatArray, spacing: float) -> tuple[float, float]:
        """Heights at which it cuts what is on slices at heights (S,); infinite where it does not."""
        low, high = self.cut(z)
        less = self.low - (self.first - spacing / 2), self.last + spacing / 2 - self.high
        return (
            float(z[0]) - self.half + less[0] if low else -np.inf,
            float(z[-1]) + self.half - less[1] if high else np.inf,
        )


def interpolate_slices(sections: Sections, settings: LoftSettings) -> SliceStack:
    """Turn what slices show into signed distances, and estimate those between them.

    Parameters
    ----------
    sections : Sections
        Where only some slices were drawn no gap is too wide, and planes across them guide what lies between.
    settings : LoftSettings
        Of these ``bridge_slices``, which may be missing before a run of slices ends, and
        ``smallest_part_voxels``.

    Raises
    ------
    InputError
        When there is no curve at all, or none goes around the centre of a pixel.
    """
    frame, annotation = sections.curves.frame, sections.annotation
    borders, left_out = _without_small(
        find_borders(sections, None if annotation is None else annotation.reach),
        frame,
        settings.smallest_part_voxels,
    )
    every = _usual_gap(borders.slices)
    step, ends = every * frame.slice_spacing, _Ends.of(frame, every * frame.slice_spacing, annotation)
    breaks = np.flatnonzero(np.diff(borders.slices) > every * settings.bridge_slices) + 1
    if annotation is not None:
        breaks = breaks[:0]
    height: FloatArray = np.asarray(borders.slices * frame.slice_spacing, float)
    voxel = np.array([step, *frame.pixel_spacing])
    slices = Slices(height, borders.distance, frame.pixel_spacing)
    z, values = _all_levels(borders, slices, step, breaks, ends)
    warnings: list[str] = []
    if annotation is not None:
        z, values, warnings = _shaped(z, values, slices, annotation, frame, borders.origin)
    cut_heights = ends.heights(height, frame.slice_spacing)
    z, values = _running_on(z, values, cut_heights, slices.pixel)
    return SliceStack(
        slices,
        SampledDistance(values, z, frame.pixel_spacing, cut_heights),
        borders.origin,
        frame.plane_to_world(borders.origin),
        voxel,
        _voxel_faces(borders.inside),
        _volume(borders, frame, step, breaks, cut_heights),
        of_some_slices=annotation is not None,
        smallest=settings.smallest_part_voxels * float(voxel.prod()),
        smallest_voxels=settings.smallest_part_voxels,
        left_out=left_out,
        warnings=tuple(warnings),
    )


def _usual_gap(slices: IntArray) -> int:
    """From one slice (S,) that shows anything to the next there are mostly so many of the scan's."""
    return int(np.median(np.diff(slices))) if len(slices) > 1 else 1


def _without_small(borders: Borders, frame: Frame, least: float) -> tuple[Borders, dict[str, list[float]]]:
    """Fill cavities of fewer voxels, and leave out such parts but for the largest; mm^3 of both."""
    every = _usual_gap(borders.slices)
    voxel = every * frame.slice_spacing * float(frame.pixel_spacing.prod())
    outside, count = label_parts(~borders.inside, borders.slices, every, touching=1)
    hidden = np.append(False, np.ones(len(count), np.bool_))
    for ends in (outside[[0, -1]], outside[:, [0, -1]], outside[:, :, [0, -1]]):
        hidden[np.unique(ends)] = False
    # voxels of a cavity that touch at a corner are one, as those of a part are
    cavities, sizes = label_parts(hidden[outside], borders.slices, every)
    filled = sizes < least
    if filled.any():
        borders = borders.without(np.append(False, filled)[cavities], frame.pixel_spacing, -1)
    gone = {"cavity": (sizes[filled] * voxel).tolist()}
    parts, sizes = label_parts(borders.inside, borders.slices, every)
    dropped = sizes < least
    dropped[np.argmax(sizes)] = False
    if dropped.any():
        borders = borders.without(np.append(False, dropped)[parts], frame.pixel_spacing)
    return borders, gone | {"fragment": (sizes[dropped] * voxel).tolist()}


def label_parts(inside: BoolArray, z: RealArray, step: float, touching: int = 3) -> tuple[IntArray, IntArray]:
    """Give each part (S, I, J) of slices at heights (S,) a number, and count their voxels (N,).

    Voxels that touch at a corner are of one part, or (``touching`` 1) those that share a face; slices more
    than a ``step`` apart do not touch.
    """
    labels, sizes, count = np.zeros(inside.shape, np.int64), [np.zeros(0, np.int64)], 0
    start = 0
    for end in [*(np.flatnonzero(np.diff(z) > 1.5 * step) + 1), len(z)]:
        found, number = ndimage.label(inside[start:end], ndimage.generate_binary_structure(3, touching))
        labels[start:end] = np.where(found > 0, found + count, 0)
        sizes.append(np.bincount(found.ravel(), minlength=number + 1)[1:])
        start, count = end, count + number
    return labels, np.concatenate(sizes)


def _all_levels(
    borders: Borders, slices: Slices, step: float, breaks: IntArray, ends: _Ends
) -> tuple[FloatArray, SingleArray]:
    """Levels of runs of slices that begin at ``breaks``: heights (L,), distances (L, I, J) in mm."""
    heights: list[FloatArray] = []
    planes: list[SingleArray] = []
    low, high = ends.cut(slices.z)
    runs = np.split(np.arange(len(slices.z)), breaks)
    for number, run in enumerate(runs):
        cut = low and number == 0, high and number == len(runs) - 1
        here = slice(run[0], run[-1] + 1)
        own = Slices(slices.z[here], slices.distance[here], slices.spacing)
        z, values = levels_of_slices(own.distance, own.z, step, own.spacing, cut, borders.exact)
        heights.append(z)
        planes.append(move_branches(z, values, own))
    return np.concatenate(heights), planes[0] if len(planes) == 1 else np.concatenate(planes)


def _shaped(
    z: FloatArray,
    values: SingleArray,
    slices: Slices,
    annotation: Annotation,
    frame: Frame,
    origin: IntArray,
) -> tuple[FloatArray, SingleArray, list[str]]:
    """Shape levels between slices of which only some were drawn: ends of parts, and planes across."""
    from cccd.surface.unannotated import ends_by_guides, guide_lines, shape_unannotated  # few masks need it

    guides = guide_lines(annotation, values.shape[1:], frame, origin)
    values, warnings = shape_unannotated(z, values, slices, guides, frame)
    heights = z.copy()
    for n, beyond in ((0, z < slices.z[0] - SAME_HEIGHT), (-1, z > slices.z[-1] + SAME_HEIGHT)):
        end, last = float(slices.z[n]), slices.distance[n]
        heights[beyond] = ends_by_guides(z[beyond], values[beyond], end, last, guides)
    return heights, values, warnings


def _running_on(
    z: FloatArray, values: SingleArray, cut: tuple[float, float], pixel: float
) -> tuple[FloatArray, SingleArray]:
    """Levels with more of the same beyond where the scan cuts."""
    below, above = np.zeros(0), np.zeros(0)
    if np.isfinite(cut[0]):
        below = np.arange(z[0] - pixel, cut[0] - RUN_ON_PIXELS * pixel, -pixel)[::-1]
    if np.isfinite(cut[1]):
        above = np.arange(z[-1] + pixel, cut[1] + RUN_ON_PIXELS * pixel, pixel)
    return np.concatenate([below, z, above]), np.concatenate(
        [np.repeat(values[:1], len(below), axis=0), values, np.repeat(values[-1:], len(above), axis=0)]
    )


def _volume(borders: Borders, frame: Frame, step: float, breaks: IntArray, cut: tuple[float, float]) -> float:
    """Volume in mm^3 of runs of slices that begin at ``breaks``, half a step beyond their ends included."""
    total, spacing = 0.0, frame.slice_spacing
    for part in np.split(np.arange(len(borders.slices)), breaks):
        area, height = borders.areas[part], borders.slices[part] * spacing
        low, high = height[0] - step / 2, height[-1] + step / 2
        if part[0] == 0 and np.isfinite(cut[0]):
            low = cut[0]
        if part[-1] == len(borders.slices) - 1 and np.isfinite(cut[1]):
            high = cut[1]
        beyond = area[0] * (height[0] - low) + area[-1] * (high - height[-1])
        total += float(np.trapezoid(area, height) + beyond)
    return total


def _voxel_faces(mask: BoolArray) -> IntArray:
    """Faces (3,) between voxels inside and outside, by axis: the vertices of marching cubes on the stack."""
    padded = np.pad(mask, 1)
    return np.array([np.count_nonzero(np.diff(padded, axis=axis)) for axis in range(3)])


def counts(mesh: Mesh, stack: SliceStack) -> dict[str, Any]:
    """Count what a closed mesh has, as plain JSON."""
    volumes = mesh.piece_volumes
    return {
        "vertices": len(mesh.vertices),
        "triangles": len(mesh.faces),
        "bodies": int(np.count_nonzero(volumes > 0)),
        "cavities": int(np.count_nonzero(volumes < 0)),
        "cut_ends": int(np.isfinite(stack.distance.ends).sum()),
    }


def warnings_of(stack: SliceStack) -> list[str]:
    """Say what of the slices is not in the surface: parts and cavities smaller than a number of voxels."""
    lines = [
        _gone(verb, one, many, stack.left_out[one], stack.smallest_voxels)
        for verb, one, many in (("dropped", "fragment", "fragments"), ("filled", "cavity", "cavities"))
        if stack.left_out[one]
    ]
    return [*lines, *stack.warnings]


def _gone(verb: str, one: str, many: str, volumes: Sequence[float], smallest_voxels: float) -> str:
    """Report what of some mm^3 each went as smaller than a number of voxels."""
    total = np.format_float_positional(sum(volumes), 3, fractional=False, trim="-")
    count, volume = len(volumes), f"{total} mm³" + (" in total" if len(volumes) > 1 else "")
    return (
        f"{verb} {count} {one if count == 1 else many} smaller than {smallest_voxels:g} voxels ({volume}); "
        "lower surface.smallest_part_voxels to keep them"
    )
