"""The stack of slices as signed distances, on the slices and on levels between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import ndimage

from cccd.bands.signs import Slices
from cccd.containers import Frame, Sections
from cccd.errors import InputError
from cccd.filling import fill_between_slices
from cccd.geometry.arrays import BoolArray, FloatArray, IntArray, SingleArray
from cccd.settings.surface import LoftSettings
from cccd.surface.endings import round_ends
from cccd.surface.fields import LevelField, distance_fields, interpolated_fields
from cccd.surface.moving_branches import move_branches
from cccd.surface.moving_sheets import move_sheets
from cccd.surface.outlines import Outlines
from cccd.surface.probability import ProbabilityTarget
from cccd.surface.target import TargetField
from cccd.surface.undrawn import guide_lines, guides_reach, shape_undrawn

__all__ = ["Run", "SliceStack", "interpolate_slices"]

#: Bytes of a control point (three float32), of a mesh vertex and of a triangle in binary PLY.
CONTROL_BYTES, VERTEX_BYTES, TRIANGLE_BYTES = 12, 12, 13
#: What the scan cuts runs on for so many pixels, as far as distances are smoothed; a plane cuts it then.
RUN_ON_PIXELS = 3.0
#: Levels between slices lie at most so many pixels apart, and half of that where their filling is learned: it
#: tells more than what lies on the slices.
LEVEL_PIXELS = 1.5
#: Slice distances, in pixels, between which the learned filling has no share in the levels, all, all, none.
#: Below them pixels tell as much as slices do; above, contours are known finely enough to be interpolated.
LEARNED_RATIOS = (1.2, 1.5, 2.5, 3.5)
#: Pixels between the knots of the spline that takes the steps of pixels off, without and with the learned
#: filling, which leaves fewer. Wider and thin branches shrink.
KNOT_PIXELS = (1.2, 1.0)


@dataclass(frozen=True, eq=False)
class Run:
    """Levels without a wide gap between them, from low to high.

    Attributes
    ----------
    fields : sequence of LevelField
        Signed distances, of the slices and of levels between them.
    spacing : (2,) float64
        mm per pixel along i and j.
    step : float
        Distance between slices in mm, where it is uneven the median one.
    half_step : float
        Half the distance between the scan's slices in mm: how far what it cuts reaches beyond its last slice.
    scan_range : (float, float)
        Heights in mm of the volume's first and last slice: an organ that reaches them was cut by the scan.
    overhang : (float, float)
        How much less that is in mm, below and above, where the file's own grid ends before.
    """

    fields: Sequence[LevelField]
    spacing: FloatArray
    step: float
    half_step: float
    scan_range: tuple[float, float]
    overhang: tuple[float, float]

    @property
    def fields_of_slices(self) -> list[LevelField]:
        """The fields of the slices themselves."""
        return [field for field in self.fields if field.source_slice is not None]


@dataclass(frozen=True, eq=False)
class SliceStack:
    """What the slices hold, in the plane's mm and height, and the sizes that it is measured by.

    Attributes
    ----------
    runs : list of Run
        Levels, split where too many slices in a row are missing.
    target : TargetField or ProbabilityTarget
        The organ's boundary as a smooth function of space.
    origin : (2,) int64
        Source ``(i, j)`` of the plane's first pixel.
    voxel : (3,) float64
        Distance between slices, and a pixel's edges along i and j, in mm.
    voxel_faces : (3,) int64
        Faces between voxels inside and outside, square to each of these.
    volume : float
        What the slices enclose in mm^3.
    of_probability : bool
        Whether the target is the level of probabilities.
    of_some_slices : bool
        Whether only some slices were drawn: ``volume`` then is an estimate.
    smallest : float
        Parts of fewer mm^3 may be left out.
    warnings : tuple of str
        What a user should know of what lies between the slices.
    """

    runs: list[Run]
    target: TargetField | ProbabilityTarget
    origin: IntArray
    voxel: FloatArray
    voxel_faces: IntArray
    volume: float
    of_probability: bool = False
    of_some_slices: bool = False
    smallest: float = 0.0
    warnings: tuple[str, ...] = ()

    @property
    def held_volume(self) -> float | None:
        """The mm^3 that a surface must hold; None where the slices only tell about how much."""
        return None if self.of_probability or self.of_some_slices else self.volume

    @property
    def step(self) -> float:
        """Distance between slices in mm."""
        return float(self.voxel[0])

    @cached_property
    def pixel(self) -> float:
        """Edge length of a pixel in mm (the geometric mean of its two)."""
        return float(np.sqrt(self.voxel[1:].prod()))

    @property
    def cut_heights(self) -> tuple[float, float]:
        """Heights in mm at which the scan cuts the organ below and above; infinite where it does not."""
        first, last = self.runs[0], self.runs[-1]
        low, high = first.fields_of_slices[0].z, last.fields_of_slices[-1].z
        return (
            low - first.half_step + first.overhang[0]
            if abs(low - first.scan_range[0]) < first.half_step
            else -np.inf,
            high + last.half_step - last.overhang[1]
            if abs(high - last.scan_range[1]) < last.half_step
            else np.inf,
        )

    def plane_to_world(self, frame: Frame) -> FloatArray:
        """Affine (4, 4) from the plane's mm and height in mm to mm RAS."""
        scale = np.diag([*(1 / frame.pixel_spacing), 1 / frame.slice_spacing, 1.0])
        scale[:2, 3] = self.origin
        return frame.stack_affine @ scale

    @cached_property
    def part_volumes(self) -> list[float]:
        """Volumes in mm^3 of the slices' parts, run by run; voxels that touch at a corner are of one part."""
        touching = ndimage.generate_binary_structure(3, 3)
        volumes: list[float] = []
        for run in self.runs:
            inside = np.stack([level.distance < 0 for level in run.fields_of_slices])
            parts, _ = ndimage.label(inside, touching)
            volumes += (np.bincount(parts.ravel())[1:] * float(self.voxel.prod())).tolist()
        return volumes

    @cached_property
    def slices(self) -> Slices:
        """The signed distances on the slices alone."""
        fields = [field for run in self.runs for field in run.fields_of_slices]
        heights = np.array([field.z for field in fields])
        return Slices(heights, np.stack([field.distance for field in fields]), self.voxel[1:])

    @property
    def marching_cubes_bytes(self) -> int:
        """Size of marching cubes' mesh of the slices in binary PLY."""
        return int(self.voxel_faces.sum()) * (VERTEX_BYTES + 2 * TRIANGLE_BYTES)


def interpolate_slices(outlines: Outlines, sections: Sections, settings: LoftSettings) -> SliceStack:
    """Turn outlines into signed distances, and interpolate levels between slices.

    Parameters
    ----------
    outlines : Outlines
        Closed polygons, outer ones and holes.
    sections : Sections
        Probabilities, which are the target where slices are near enough to each other, and the annotation:
        where only some slices were drawn, no gap is too wide, and planes across them guide what lies between.
    settings : LoftSettings
        Of these ``bridge_slices``, which may be missing before a run of levels ends, and
        ``smallest_part_voxels``.

    Raises
    ------
    InputError
        When there is no curve at all, or none goes around the centre of a pixel.
    """
    frame, probability, annotation = outlines.curves.frame, sections.probability, sections.annotation
    spacing = frame.pixel_spacing
    pixel = float(np.sqrt(spacing.prod()))
    slices, distance, origin = distance_fields(outlines, guides_reach(annotation))
    gaps = np.diff(slices)
    every = int(np.median(gaps)) if len(gaps) else 1
    step = every * frame.slice_spacing
    scan_range = (0.0, (frame.shape[frame.slice_axis] - 1) * frame.slice_spacing)
    half_step = (step if annotation is None else frame.slice_spacing) / 2
    low_face, high_face = frame.ends
    overhang = (
        low_face - (scan_range[0] - frame.slice_spacing / 2),
        scan_range[1] + frame.slice_spacing / 2 - high_face,
    )
    breaks = (
        np.flatnonzero(gaps > every * settings.bridge_slices) + 1 if annotation is None else np.array([], int)
    )
    share = float(np.interp(step / pixel, LEARNED_RATIOS, (0.0, 1.0, 1.0, 0.0)))
    certain = 0.0 if probability is None else float(np.interp(step / pixel, LEARNED_RATIOS[2:], (1.0, 0.0)))
    level_spacing = (1 - share / 2) * LEVEL_PIXELS * pixel
    guides = guide_lines(annotation, distance.shape[1:], frame, origin)
    runs: list[Run] = []
    warnings: list[str] = []
    for part in np.split(np.arange(len(slices)), breaks):
        here = slice(part[0], part[-1] + 1)
        fields = list(interpolated_fields(slices[here], distance[here], frame.slice_spacing, level_spacing))
        if share < 1:
            fields = move_sheets(fields, spacing)
        if share > 0 and np.all(np.diff(slices[here]) == every):
            fields = _filled(fields, distance[here], outlines, step, scan_range, share)
        cut = abs(fields[0].z - scan_range[0]) < half_step, abs(fields[-1].z - scan_range[1]) < half_step
        fields = move_branches(fields, spacing)
        rounded = round_ends(fields, distance[here], spacing, step, cut, level_spacing, guides)
        if annotation is None:
            fields = rounded
        else:  # between its slices parts end half way
            below = [level for level in rounded if level.z < fields[0].z]
            above = [level for level in rounded if level.z > fields[-1].z]
            fields, warnings = shape_undrawn([*below, *fields, *above], guides, frame)
        runs.append(Run(fields, spacing, step, half_step, scan_range, overhang))
    if not np.any(distance < 0):
        raise InputError(
            "curves", "no curve goes around the centre of a pixel", "check the contours and the grid"
        )
    voxel, voxel_faces = np.array([step, *spacing]), _voxel_faces(distance < 0)
    areas = _areas(outlines, slices)
    volume = _volume(slices, areas, frame.slice_spacing, step, breaks)
    at_ends = np.array([slices[0] == 0, slices[-1] == frame.shape[frame.slice_axis] - 1])
    volume -= float(areas[[0, -1]] @ (at_ends * overhang))
    widest = settings.bridge_slices * step + pixel
    smallest = settings.smallest_part_voxels * float(voxel.prod())
    run_on = RUN_ON_PIXELS * pixel
    knot = float(np.interp(share, (0, 1), KNOT_PIXELS))
    target: TargetField | ProbabilityTarget
    target = TargetField.of(_levels(runs, run_on, level_spacing), spacing, widest, knot)
    if certain > 0 and probability is not None:
        target = ProbabilityTarget.of(probability, frame, origin, target)
    return SliceStack(
        runs,
        target,
        origin,
        voxel,
        voxel_faces,
        volume,
        of_probability=certain > 0,
        of_some_slices=annotation is not None,
        smallest=smallest,
        warnings=tuple(warnings),
    )


def _filled(
    fields: Sequence[LevelField],
    distance: SingleArray,
    outlines: Outlines,
    step: float,
    scan_range: tuple[float, float],
    share: float,
) -> list[LevelField]:
    """Give the learned filling its share in the fields of slices (S, I, J) ``step`` mm apart and between."""
    low, high = abs(fields[0].z - scan_range[0]), abs(fields[-1].z - scan_range[1])
    pixel = float(np.sqrt(outlines.curves.frame.pixel_spacing.prod()))
    cut = low < step / 2, high < step / 2
    filling = fill_between_slices(distance, pixel, step, cut, outlines.of_pixels)
    return [
        replace(
            field,
            distance=np.float32(1 - share) * field.distance
            + np.float32(share) * filling.field((field.z - fields[0].z) / step),
        )
        for field in fields
    ]


def _levels(runs: Sequence[Run], run_on: float, level_spacing: float) -> list[LevelField]:
    """All runs' fields by height; what the scan cuts runs on beyond its planar cap, level by level."""
    fields = [plane for run in runs for plane in run.fields]
    half_step, scan_range = runs[0].half_step, runs[0].scan_range
    far = half_step + run_on
    rises = np.linspace(0, far, int(np.ceil(far / level_spacing)) + 1)[1:]
    below, above = (
        [replace(end, z=end.z + float(way * rise)) for rise in rises]
        if abs(end.z - border) < half_step
        else []
        for way, end, border in ((-1, fields[0], scan_range[0]), (1, fields[-1], scan_range[1]))
    )
    return [*below[::-1], *fields, *above]


def _areas(outlines: Outlines, slices: IntArray) -> FloatArray:
    """Area in mm^2 of what the outlines of each slice (S,) stand for."""
    pixel = float(outlines.curves.frame.pixel_spacing.prod())
    owner = np.searchsorted(slices, outlines.curves.slice)
    return pixel * np.bincount(owner, outlines.areas, len(slices)).astype(float)


def _volume(slices: IntArray, areas: FloatArray, spacing: float, step: float, breaks: IntArray) -> float:
    """Volume in mm^3 of runs of slices that begin at ``breaks``, half a step beyond their ends included."""
    total = 0.0
    for part in np.split(np.arange(len(slices)), breaks):
        area, height = areas[part], slices[part] * spacing
        total += float(np.trapezoid(area, height) + (area[0] + area[-1]) * step / 2)
    return total


def _voxel_faces(mask: BoolArray) -> IntArray:
    """Faces (3,) between voxels inside and outside, by axis: the vertices of marching cubes on the stack."""
    padded = np.pad(mask, 1)
    return np.array([np.count_nonzero(np.diff(padded, axis=axis)) for axis in range(3)])
