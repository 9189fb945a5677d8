"""What lies between slices of which only some were drawn.

The slices' distances alone let a part that moves aside from slice to slice shrink between them, and end where
the next slice has nothing below it. So parts that follow each other are moved onto each other on the way.
Where planes across the slices were drawn as well, levels are stretched until they meet the planes' outlines.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.ndimage import label, map_coordinates, shift
from scipy.optimize import linear_sum_assignment

from cccd.containers import Annotation, Frame, Guide
from cccd.geometry.arrays import BoolArray, FloatArray, IntArray, SingleArray
from cccd.geometry.distance import to_mask
from cccd.surface.fields import LevelField, distance_to_part, interpolated_planes

__all__ = ["GuideLine", "guide_lines", "guides_reach", "shape_undrawn"]

#: A part runs on in one that it does not overlap if that begins no further aside, per mm between slices: at
#: twice that, bends of the colon and bronchi are joined to what they are no part of.
STEEPEST = 0.25
#: A part is moved onto the next where that makes up for so much of what they do not share: not at all at the
#: first, all the way at the second. Organs that change their shape are nearer to the truth where they lie.
MOTION = (0.3, 0.7)
#: A part that has nothing to run on in closes as a paraboloid so high, as a share of the way to the next
#: slice: all that is known is that it ends before that.
HEIGHT = 0.5
#: Where stretching alone does not bring a level to a plane's outline, it is corrected so far to either side
#: of the plane, as a share of the distance between the drawn slices.
REACH = 0.25


def guides_reach(annotation: Annotation | None) -> IntArray | None:
    """First and last source ``(i, j)`` (2, 2) of what was drawn on planes across; None without any."""
    if annotation is None or not annotation.guides:
        return None
    ends = np.array([_extent(guide) for guide in annotation.guides])
    return np.stack([ends[:, 0].min(axis=0), ends[:, 1].max(axis=0)])


def _extent(guide: Guide) -> IntArray:
    """First and last source ``(i, j)`` (2, 2) of what was drawn on a plane."""
    along = np.flatnonzero(guide.inside.any(axis=0)) + int(guide.origin[1])
    ends = np.full((2, 2), guide.index, np.int64)
    ends[:, 1 - guide.axis] = along[[0, -1]]
    return ends


def shape_undrawn(
    fields: Sequence[LevelField], guides: Sequence[GuideLine], frame: Frame
) -> tuple[list[LevelField], list[str]]:
    """Shape the levels between drawn slices.

    Parameters
    ----------
    fields : sequence of LevelField
        Of the drawn slices, and interpolated between them.
    guides : sequence of GuideLine
        The planes across the slices.
    frame : Frame
        The scan's.

    Returns
    -------
    fields : list of LevelField
        Those of the drawn slices are as they were.
    warnings : list of str
        How many parts do not overlap the next slice's, and what became of them.
    """
    spacing = frame.pixel_spacing
    drawn = [n for n, field in enumerate(fields) if field.source_slice is not None]
    slices = [_Slice.of(fields[n]) for n in drawn]
    gaps = [_Gap.of(below, above, spacing) for below, above in itertools.pairwise(slices)]
    z = np.array([field.z for field in fields])
    moving: dict[int, SingleArray] = {}
    for chain in _chains(gaps):
        for n, plane in _moving_fields(chain, slices, gaps, z, spacing):
            moving[n] = np.minimum(moving[n], plane) if n in moving else plane
    shaped = list(fields)
    for gap, (low, high) in zip(gaps, itertools.pairwise(drawn), strict=True):
        rest, endings = _rest(gap, spacing), _endings(gap, spacing)
        for n in range(low + 1, high):
            distance = fields[n].distance
            if n in moving:
                moved = moving.pop(n)
                distance = moved if rest is None else np.where(rest, np.minimum(distance, moved), moved)
            share = (z[n] - z[low]) / (z[high] - z[low])
            for ending in endings:
                distance = np.minimum(distance, ending.at(share))
            reach = REACH * (fields[high].z - fields[low].z)
            distance = _guided(distance, guides, fields[n].z / frame.slice_spacing, reach)
            shaped[n] = replace(fields[n], distance=distance)
    return shaped, _warnings(gaps)


def _warnings(gaps: Sequence[_Gap]) -> list[str]:
    """Say what became of parts that do not overlap those of the next drawn slice."""
    moved, ending = (
        sum(gap.aside for gap in gaps),
        sum(len(numbers) for gap in gaps for numbers in gap.ending),
    )
    notes: list[str] = []
    if moved:
        notes.append(
            f"{moved} parts do not overlap with the next annotated slice: joined by leaning branches"
        )
    if ending:
        notes.append(
            f"{ending} parts have no counterpart on the next annotated slice: they end half way to it"
        )
    return notes


# parts ------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Slice:
    """A drawn slice and its parts: 0 outside them in ``parts`` (I, J), n for part n of ``count`` from 1."""

    z: float
    distance: SingleArray
    parts: IntArray
    count: int

    @classmethod
    def of(cls, field: LevelField) -> _Slice:
        """Find the parts of a field."""
        parts, count = label(field.distance < 0)
        return cls(field.z, field.distance, np.asarray(parts, np.int64), count)

    def distance_of(self, number: int, spacing: FloatArray) -> SingleArray:
        """Signed distances (I, J) in mm to one of the parts."""
        return distance_to_part(self.distance, self.parts, number, spacing)

    def centre(self, number: int) -> FloatArray:
        """Centre (2,) of a part's pixels."""
        return np.argwhere(self.parts == number).mean(axis=0)


@dataclass(frozen=True, eq=False)
class _Gap:
    """What lies between two drawn slices.

    Attributes
    ----------
    below, above : _Slice
    pairs : dict of int to int
        Parts below that run on in one above, and in nothing else, and have moved on the way.
    ways : dict of int to (2,) float64
        Pixels by which each of these parts below has moved.
    aside : int
        How many of these do not overlap.
    ending : pair of sets of int
        Parts below, and above, that have nothing to run on in.
    """

    below: _Slice
    above: _Slice
    pairs: dict[int, int]
    ways: dict[int, FloatArray]
    aside: int
    ending: tuple[set[int], set[int]]

    @classmethod
    def of(cls, below: _Slice, above: _Slice, spacing: FloatArray) -> _Gap:
        """Find which parts follow each other; what overlaps nothing goes to the nearest such part near by."""
        both = (below.parts > 0) & (above.parts > 0)
        touching = np.unique(np.column_stack([below.parts[both], above.parts[both]]), axis=0)
        single = [
            (int(a), int(b))
            for a, b in touching
            if np.count_nonzero(touching[:, 0] == a) == 1 and np.count_nonzero(touching[:, 1] == b) == 1
        ]
        free = [
            np.setdiff1d(np.arange(1, side.count + 1), touching[:, n])
            for n, side in enumerate((below, above))
        ]
        aside = _nearest(below.parts, above.parts, free, spacing, STEEPEST * (above.z - below.z))
        taken = [{a for a, _ in aside}, {b for _, b in aside}]
        ending = set(map(int, free[0])) - taken[0], set(map(int, free[1])) - taken[1]
        ways = {a: _way(below, above, a, b) for a, b in single}
        ways |= {a: above.centre(b) - below.centre(a) for a, b in aside}
        pairs = {a: b for a, b in [*single, *aside] if ways[a].any()}
        return cls(below, above, pairs, ways, len(aside), ending)


def _way(below: _Slice, above: _Slice, a: int, b: int) -> FloatArray:
    """Pixels (2,) by which a part has moved to one that it overlaps; none if moving it gains little."""
    lower, upper = below.parts == a, above.parts == b
    way = above.centre(b) - below.centre(a)
    shared, matched = (
        np.count_nonzero(there & upper) / np.count_nonzero(there | upper)
        for there in (lower, _moved(np.where(lower, np.float32(1), np.float32(0)), way) >= 0.5)
    )
    gain = (matched - shared) / max(1 - shared, 1e-9)
    return float(np.interp(gain, MOTION, (0.0, 1.0))) * way


def _nearest(
    lower: IntArray, upper: IntArray, free: Sequence[IntArray], spacing: FloatArray, most: float
) -> list[tuple[int, int]]:
    """Pairs of ``free`` parts of two slices that lie least far aside, none further than ``most`` mm."""
    if not (len(free[0]) and len(free[1])):
        return []
    away = [to_mask(lower == a, spacing) for a in free[0]]
    apart = np.array([[float(plane[upper == b].min()) for b in free[1]] for plane in away])
    rows, columns = linear_sum_assignment(np.minimum(apart, 2 * most))
    near = apart[rows, columns] <= most
    return [(int(free[0][a]), int(free[1][b])) for a, b in zip(rows[near], columns[near], strict=True)]


def _chains(gaps: Sequence[_Gap]) -> list[list[tuple[int, int]]]:
    """Parts (drawn slice, number) that run on in each other from slice to slice, two at least."""
    chains: list[list[tuple[int, int]]] = []
    open_chains: dict[int, list[tuple[int, int]]] = {}
    for n, gap in enumerate(gaps):
        following: dict[int, list[tuple[int, int]]] = {}
        for a, b in gap.pairs.items():
            if a not in open_chains:
                open_chains[a] = [(n, a)]
                chains.append(open_chains[a])
            open_chains[a].append((n + 1, b))
            following[b] = open_chains[a]
        open_chains = following
    return chains


def _moving_fields(
    chain: Sequence[tuple[int, int]],
    slices: Sequence[_Slice],
    gaps: Sequence[_Gap],
    z: FloatArray,
    spacing: FloatArray,
) -> Iterator[tuple[int, SingleArray]]:
    """Fields (I, J) of a chain of parts on the levels at heights ``z`` between its slices, numbered.

    The parts are interpolated where the first one lies, and moved back along a smooth path.
    """
    heights = np.array([slices[n].z for n, _ in chain])
    ways = [gaps[n].ways[number] for n, number in chain[:-1]]
    path = np.concatenate([np.zeros((1, 2)), np.cumsum(ways, axis=0)])
    planes = [
        _moved(slices[n].distance_of(number, spacing), -away)
        for (n, number), away in zip(chain, path, strict=True)
    ]
    levels = np.flatnonzero((z > heights[0]) & (z < heights[-1]) & ~np.isin(z, heights))
    back = PchipInterpolator(heights, path)
    still = interpolated_planes(heights, np.stack(planes), z[levels])
    for n, plane in zip(levels, still, strict=True):
        yield int(n), _moved(plane, back(z[n]))


def _moved(plane: SingleArray, by: FloatArray) -> SingleArray:
    """Plane (I, J) moved by some pixels (2,); what comes in over its border is as the border was."""
    return np.asarray(shift(plane, by, np.float32, order=1, mode="nearest"), np.float32)


def _rest(gap: _Gap, spacing: FloatArray) -> BoolArray | None:
    """Pixels (I, J) nearer to parts that branch, end or merge between two slices than to others, if any."""
    sides = (gap.below, list(gap.pairs)), (gap.above, list(gap.pairs.values()))
    follows = [np.isin(side.parts, numbers) for side, numbers in sides]
    branches = [(side.parts > 0) & ~inside for (side, _), inside in zip(sides, follows, strict=True)]
    if not np.any(branches):
        return None
    return to_mask(np.any(branches, axis=0), spacing) < to_mask(np.any(follows, axis=0), spacing)


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


def _endings(gap: _Gap, spacing: FloatArray) -> list[_Ending]:
    """Parts that end between two slices."""
    sides = (gap.below, gap.above)
    return [
        _Ending(sides[side].distance_of(number, spacing), side)
        for side, numbers in enumerate(gap.ending)
        for number in sorted(numbers)
    ]


# planes across the slices -----------------------------------------------------------------------------


def guide_lines(
    annotation: Annotation | None, shape: Sequence[int], frame: Frame, origin: IntArray
) -> list[GuideLine]:
    """Planes across the slices as they meet fields (I, J) that begin at the source's ``origin`` (2,)."""
    guides = () if annotation is None else annotation.guides
    return [GuideLine.of(guide, shape, frame, origin) for guide in guides]


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

    def rise(self, part: BoolArray, z: float, way: int) -> float | None:
        """How far in mm a part (I, J) goes on, up (1) or down (-1); None where the plane misses it."""
        met = np.flatnonzero(np.moveaxis(part, self.axis, 0)[self.row])
        start = round(z / self.step) - self.first
        if len(met) == 0 or not 0 <= start < len(self.lines):
            return None
        beyond = self.lines[start + 1 :, met] if way > 0 else self.lines[:start, met][::-1]
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
    """Stretch a plane (I, J) along j until it crosses zero where it does on known rows (row, (J,)).

    Only rows that cross zero as often as they should take part; between them the stretch is interpolated.
    What lies nearer to a part that no such row meets stays as it is.
    """
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
    if len(rows) == 1:
        return np.repeat(values, count, axis=0)
    at = np.clip(np.arange(count), rows[0], rows[-1])
    low = np.clip(np.searchsorted(rows, at, side="right") - 1, 0, len(rows) - 2)
    share = ((at - rows[low]) / (rows[low + 1] - rows[low]))[:, None]
    return (1 - share) * values[low] + share * values[low + 1]
