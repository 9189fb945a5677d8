"""A tube as a grid of samples: sections x points around, with what each sample is worth to a fit."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.ndimage import maximum_filter1d

from cccd.geometry.arrays import BoolArray, FloatArray, ranks_of
from cccd.settings.surface import FittingSettings
from cccd.surface.alignment import align, at_fractions, outward_normals
from cccd.surface.target import TargetDistance
from cccd.surface.tubes import Tube

__all__ = ["Samples", "lengths", "sample_tube"]


@dataclass(frozen=True, eq=False)
class Samples:
    """A tube as a grid of samples.

    Attributes
    ----------
    outlines : (A, M, 2) float64
        mm; sections at equal steps of arc length.
    position : (A, M) float64
        Fractions of the way around each section that correspond to each other.
    z, area : (A,) float64
        Heights in mm, and area in mm^2 that each section stands for.
    v : (A + number of poles,) float64
        Parameter along the tube, in mm of surface.
    normal : (A, M, 2) float64
        The surface's outward normal, split into its part in the plane (1 on a vertical wall) and along z.
    poles : pair of (3,) float64 or None
        Where the ends close.
    weights : (A, M) float64
        How much each sample matters: less where other tubes or a blend hide the surface.
    jumps : (P, 3) float64
        mm; points between sections, along the lines where the tube jumps from one to the next.
    pixel : float
        mm.
    """

    outlines: FloatArray
    position: FloatArray
    z: FloatArray
    v: FloatArray
    area: FloatArray
    normal: FloatArray
    poles: tuple[FloatArray | None, FloatArray | None]
    weights: FloatArray
    jumps: FloatArray
    pixel: float

    @property
    def around(self) -> int:
        """Number of samples around."""
        return self.outlines.shape[1]

    @property
    def section_v(self) -> FloatArray:
        """Parameters (A,) of the sections, without the poles."""
        return _without_poles(self.v, self.poles)

    @property
    def strips(self) -> FloatArray:
        """Area in mm^2 of the surface that each sample (A, M) stands for."""
        along = np.gradient(self.section_v) if len(self.z) > 1 else np.ones(1)
        around = lengths(self.outlines) / self.around
        return np.repeat((along * around)[:, None], self.around, axis=1)

    @cached_property
    def surface_area(self) -> float:
        """Area in mm^2 of the tube's surface between its sections, by weight."""
        return float((self.weights * self.strips).sum())


def lengths(outlines: FloatArray) -> FloatArray:
    """Lengths (A,) of closed polygons (A, M, 2)."""
    return np.sum(np.linalg.norm(np.roll(outlines, -1, axis=1) - outlines, axis=2), axis=1)


def sample_tube(
    tube: Tube, count: int, target: TargetDistance, pixel: float, reach: float, settings: FittingSettings
) -> Samples:
    """Sample every section at ``count`` points and lay the parameter along the tube.

    Samples that are not on the target field's zero level, within a pixel or two, and those within
    ``reach`` mm of such ones, are hidden in the end; so are those beside a jump.
    """
    outlines, position = align(tube, count, settings)
    matched = at_fractions(outlines, position)
    z = np.array([section.z for section in tube.sections])
    area = np.array([section.area for section in tube.sections])
    points, heights = _with_poles(matched, z, tube.poles)
    v = _arc_parameters(points, heights, tube.poles)
    normal = _without_poles(_surface_normals(points, heights), tube.poles)
    lines = np.dstack([matched, np.broadcast_to(z[:, None], matched.shape[:2])])
    step = np.linalg.norm(np.diff(matched, axis=0), axis=2)
    jump = step > settings.jump_pixels * pixel
    jumps = _between(lines[:-1][jump], lines[1:][jump], step[jump], reach / 2)
    distance, room = target(lines.reshape(-1, 3), -np.inf)
    away = ((np.abs(distance) > settings.hidden_pixels * pixel) & (room > 0)).reshape(matched.shape[:2])
    hidden = _widened(away, reach, _without_poles(v, tube.poles), outlines)
    beside_jump = np.pad(jump, ((1, 0), (0, 0))) | np.pad(jump, ((0, 1), (0, 0)))
    weights = np.where(hidden | beside_jump, settings.hidden_weight, 1.0)
    return Samples(outlines, position, z, v, area, normal, tube.poles, weights, jumps, pixel)


def _with_poles(
    matched: FloatArray, z: FloatArray, poles: tuple[FloatArray | None, ...]
) -> tuple[FloatArray, FloatArray]:
    """Put a row for each pole before or behind matched points (A, M, 2) and heights (A,)."""
    low, high = (
        (np.zeros((0, *matched.shape[1:])), np.zeros(0))
        if pole is None
        else (np.full((1, *matched.shape[1:]), pole[:2]), pole[2:])
        for pole in poles
    )
    return np.concatenate([low[0], matched, high[0]]), np.concatenate([low[1], z, high[1]])


def _without_poles(rows: FloatArray, poles: tuple[FloatArray | None, ...]) -> FloatArray:
    """Drop the rows (A, ...) of poles."""
    low, high = (pole is not None for pole in poles)
    return rows[int(low) : len(rows) - int(high)]


def _arc_parameters(
    points: FloatArray,
    heights: FloatArray,
    poles: tuple[FloatArray | None, ...],
) -> FloatArray:
    """Parameters (A,) of rows of points (A, M, 2): how far the median point travels along the surface."""
    outwards = outward_normals(points)
    moved = np.abs(np.sum(np.diff(points, axis=0) * (outwards[1:] + outwards[:-1]) / 2, axis=2))
    for row, neighbour, pole in ((0, 1, poles[0]), (-1, -2, poles[1])):
        if pole is not None:  # a pole has no normal: its neighbours travel all the way to it
            moved[row] = np.linalg.norm(points[row] - points[neighbour], axis=1)
    travelled = np.hypot(np.diff(heights), np.median(moved, axis=1))
    return np.concatenate([[0.0], np.cumsum(np.maximum(travelled, 1e-6))])


def _surface_normals(points: FloatArray, heights: FloatArray) -> FloatArray:
    """Outward normals (A, M, 2) of the surface through rows of points, in the plane and along z."""
    run = np.sum(np.gradient(points, axis=0) * outward_normals(points), axis=2)
    climb = np.broadcast_to(np.gradient(heights)[:, None], run.shape)
    return np.stack([climb, -run], axis=2) / np.maximum(np.hypot(climb, run), 1e-9)[..., None]


def _between(start: FloatArray, end: FloatArray, length: FloatArray, apart: float) -> FloatArray:
    """Points (P, 3) inside segments from ``start`` to ``end`` (J, 3), no further ``apart`` than that."""
    pieces = np.ceil(length / apart).astype(np.int64)
    segment = np.repeat(np.arange(len(length)), pieces)
    share = (ranks_of(pieces) + 0.5) / pieces[segment]
    return start[segment] + share[:, None] * (end - start)[segment]


def _widened(away: BoolArray, reach: float, v: FloatArray, outlines: FloatArray) -> BoolArray:
    """Mark all samples (A, M) within ``reach`` mm of marked ones, along the tube and around it."""
    if not away.any():
        return away
    along = np.median(np.gradient(v)) if len(v) > 1 else np.inf
    around = np.median(lengths(outlines)) / away.shape[1]
    rows, columns = int(reach / along), min(int(reach / around), away.shape[1] // 2)
    near = maximum_filter1d(away, 2 * columns + 1, axis=1, mode="wrap")
    return maximum_filter1d(near, 2 * rows + 1, axis=0, mode="nearest")
