"""What lies between slices of which only some were drawn.

A part that has nothing to run on in on the next drawn slice ends half way to it. Where planes across the
slices were drawn as well, levels are stretched until they meet the planes' outlines.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import label, map_coordinates

from cccd.bands import Slices
from cccd.containers import Annotation, Frame, Guide
from cccd.geometry.arrays import BoolArray, FloatArray, IntArray, SingleArray
from cccd.geometry.distance import to_mask
from cccd.surface.distances import distance_to_part
from cccd.surface.moving_branches import SliceGap, SliceParts, follow_branches, levels_between

#: A part that has nothing to run on in closes as a paraboloid so high, as a share of the way to the next
#: slice: all that is known is that it ends before that.
HEIGHT = 0.5
#: Where stretching alone does not bring a level to a plane's outline, it is corrected so far to either side
#: of the plane, as a share of the distance between the drawn slices.
REACH = 0.25


def shape_unannotated(
    z: FloatArray, values: SingleArray, slices: Slices, guides: Sequence[GuideLine], frame: Frame
) -> tuple[SingleArray, list[str]]:
    """Shape the levels between drawn slices.

    Parameters
    ----------
    z : (L,) float64
        Heights of levels in mm, ascending.
    values : (L, I, J) float32
        Distances in mm on them.
    slices : Slices
        As they were drawn.
    guides : sequence of GuideLine
        The planes across the slices.
    frame : Frame
        The scan's.

    Returns
    -------
    values : (L, I, J) float32
    warnings : list of str
        How many parts end.
    """
    shaped, ending = values.copy(), _endings(slices)
    gaps = levels_between(z, slices.z)
    for (low, high), between, parts in zip(itertools.pairwise(slices.z), gaps, ending, strict=True):
        for n in between:
            for part in parts:
                shaped[n] = np.minimum(shaped[n], part.at((z[n] - low) / (high - low)))
            shaped[n] = _guided(shaped[n], guides, float(z[n]) / frame.slice_spacing, REACH * (high - low))
    count = sum(map(len, ending))
    if not count:
        return shaped, []
    return shaped, [f"{count} parts have no counterpart on the next annotated slice: they end half way to it"]


def ends_by_guides(
    z: FloatArray, values: SingleArray, end: float, last: SingleArray, guides: Sequence[GuideLine]
) -> FloatArray:
    """Heights (B,) of levels beyond the first or the last slice where planes across show the organ's end.

    Parameters
    ----------
    z, values : (B,) float64, (B, I, J) float32
        The levels.
    end, last : float, (I, J) float32
        The slice.
    guides : sequence of GuideLine
    """
    rises = [(guide, guide.rise(last < 0, end, bool(z[0] > end))) for guide in guides if len(z)]
    known = [(rise, guide) for guide, rise in rises if rise is not None]
    if not known:
        return z
    rise, guide = max(known, key=lambda one: one[0])
    away = np.abs(z - end)
    order = np.argsort(away, kind="stable")
    nearest = np.array([plane.take(guide.row, guide.axis).min() for plane in (last, *values[order])])
    away = np.append(0.0, away[order])
    first = int(np.argmax(nearest >= 0))
    ends = float(np.interp(0.0, nearest[first - 1 : first + 1], away[first - 1 : first + 1]))
    return end + (z - end) * rise / ends


# parts that end ---------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Ending:
    """A part that ends between its slice, the lower (0) or upper one (1) of two, and the other."""

    distance: SingleArray
    side: int

    def at(self, share: float) -> SingleArray:
        """Distances (I, J) in mm at a share of the way up: the part shrinks to nothing."""
        gone = min((share, 1 - share)[self.side] / HEIGHT, 1.0)
        depth = np.float32(1 - np.sqrt(1 - gone))
        return self.distance - depth * self.distance.min()


def _endings(slices: Slices) -> list[list[_Ending]]:
    """Parts that overlap nothing on the next slice and lead nowhere, gap by gap."""
    spacing = slices.spacing
    sections = [
        SliceParts.of(plane, spacing, float(height))
        for plane, height in zip(slices.distance, slices.z, strict=True)
    ]
    found: list[list[_Ending]] = []
    for (below, above), ways in zip(
        itertools.pairwise(sections), follow_branches(sections, spacing), strict=True
    ):
        gap = SliceGap.between(below, above)
        followed = {way.low for way in ways}, {way.high for way in ways}
        found.append(
            [
                _Ending(distance_to_part(parts.distance, parts.labels, part + 1, spacing), side)
                for side, parts in enumerate((below, above))
                for part in np.flatnonzero(gap.free(side == 1)).tolist()
                if part not in followed[side]
            ]
        )
    return found


# planes across the slices -----------------------------------------------------------------------------


def guide_lines(
    annotation: Annotation, shape: Sequence[int], frame: Frame, origin: IntArray
) -> list[GuideLine]:
    """Planes across the slices as they meet fields (I, J) that begin at the source's ``origin`` (2,)."""
    return [GuideLine.of(guide, shape, frame, origin) for guide in annotation.guides]


@dataclass(frozen=True, eq=False)
class GuideLine:
    """A plane across the slices as it meets the levels.

    Attributes
    ----------
    axis : int
        0 where it meets them in a row at one i, 1 in a column at one j.
    row : int
        That i or j, in the fields' pixels.
    first : int
        The source slice of its lowest line.
    lines : (S, L) float32
        Signed distances in mm along the row or column, slice by slice.
    pixel, step : float
        mm per pixel square to the plane, and per slice.
    """

    axis: int
    row: int
    first: int
    lines: SingleArray
    pixel: float
    step: float

    @classmethod
    def of(cls, guide: Guide, shape: Sequence[int], frame: Frame, origin: IntArray) -> GuideLine:
        """Measure the distances on a plane, over all of the length of fields (I, J) from ``origin`` on."""
        along = 1 - guide.axis
        before = int(guide.origin[1] - origin[along])
        inside = np.zeros((len(guide.inside), shape[along]), bool)
        inside[:, before : before + guide.inside.shape[1]] = guide.inside
        distance = to_mask(inside, np.array([frame.slice_spacing, frame.pixel_spacing[along]]))
        row = int(guide.index - origin[guide.axis])
        pixel = float(frame.pixel_spacing[guide.axis])
        return cls(guide.axis, row, int(guide.origin[0]), distance, pixel, frame.slice_spacing)

    def line(self, k: float) -> SingleArray:
        """Distances (L,) at a height in slices."""
        at = float(np.clip(k - self.first, 0, len(self.lines) - 1))
        low = int(at)
        share = np.float32(at - low)
        return (1 - share) * self.lines[low] + share * self.lines[min(low + 1, len(self.lines) - 1)]

    def rise(self, part: BoolArray, z: float, upwards: bool) -> float | None:
        """How far in mm a part (I, J) goes on; None where the plane misses it."""
        met = np.flatnonzero(np.moveaxis(part, self.axis, 0)[self.row])
        start = round(z / self.step) - self.first
        if len(met) == 0 or not 0 <= start < len(self.lines):
            return None
        beyond = self.lines[start + 1 :, met] if upwards else self.lines[:start, met][::-1]
        slices = np.logical_and.accumulate(beyond < 0, axis=0).sum(axis=0).max(initial=0)
        return (float(slices) + 0.5) * self.step


def _guided(distance: SingleArray, guides: Sequence[GuideLine], k: float, reach: float) -> SingleArray:
    """Distances (I, J) of a level ``k`` slices high that meet what was drawn on planes across it."""
    for axis in (0, 1):
        here = [guide for guide in guides if guide.axis == axis]
        if not here:
            continue
        plane = distance if axis == 0 else distance.T
        plane = _stretched(plane, [(guide.row, guide.line(k)) for guide in here])
        for guide in here:
            line, found = guide.line(k), plane[guide.row]
            wrong = (line < 0) != (found < 0)
            if wrong.any():
                push = np.where(wrong, np.clip(line, -guide.pixel, guide.pixel) - found, np.float32(0))
                away = np.abs(np.arange(len(plane)) - guide.row) * guide.pixel
                weight = np.clip(1 - away / reach, 0, 1).astype(np.float32)
                plane = plane + weight[:, None] * push
        distance = plane if axis == 0 else plane.T
    return distance


def _stretched(plane: SingleArray, known: Sequence[tuple[int, SingleArray]]) -> SingleArray:
    """Stretch a plane (I, J) along j until it crosses zero where it does on known rows (row, (J,))."""
    # Only rows that cross zero as often as they should take part; between them the stretch is interpolated.
    # What lies nearer to a part that no such row meets stays as it is.
    pulls: dict[int, FloatArray] = {}
    columns = np.arange(plane.shape[1], dtype=np.float64)
    for row, line in known:
        is_at, has_at = _crossings(line), _crossings(plane[row])
        if len(is_at) == len(has_at) > 0:
            pulls[row] = np.interp(columns, is_at, has_at - is_at)
    if not pulls:
        return plane
    rows = np.array(sorted(pulls))
    pull = _between_rows(rows, np.array([pulls[row] for row in rows]), len(plane))
    i, j = np.indices(plane.shape, np.float32)
    moved = np.asarray(map_coordinates(plane, [i, j + pull], np.float32, order=1, mode="nearest"))
    parts, _ = label(plane < 0)
    met = np.unique(parts[rows])
    others = (parts > 0) & ~np.isin(parts, met[met > 0])
    if not others.any():
        return moved
    ones = np.ones(2)
    nearer = to_mask((parts > 0) & ~others, ones) <= to_mask(others, ones)
    return np.where(nearer, moved, plane)


def _crossings(line: SingleArray) -> FloatArray:
    """Positions at which a line's values change sign, by linear interpolation."""
    before = np.flatnonzero((line[1:] < 0) != (line[:-1] < 0))
    return before + line[before] / (line[before] - line[before + 1])


def _between_rows(rows: IntArray, values: FloatArray, count: int) -> FloatArray:
    """Values (R, J) of some ascending rows on all rows (count, J): linear between, the last ones beyond."""
    columns: list[FloatArray] = [np.interp(np.arange(count), rows, column) for column in values.T]
    return np.array(columns, np.float64).T
