"""Slits and plates that move aside from slice to slice: fissures between lobes, folds, thin walls.

Where one has moved by more than it is wide, distances that are interpolated pixel by pixel break it into a
chain of pearls. So its middle line on a slice is followed to that on the next, and between the two slices
what lies around it is interpolated along that way. Only ways square to the line are seen, and needed.
Where a sheet opens into the outside between two slices, its line ends, and it goes on as it came.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from dataclasses import fields as dataclass_fields

import numpy as np
from scipy.ndimage import gaussian_filter
from scipy.spatial import cKDTree

from cccd.geometry.arrays import AnyArray, FloatArray, IntArray, SingleArray
from cccd.surface.fields import LevelField, sampled
from cccd.tolerances import TINY

__all__ = ["Displacements", "MiddleLine", "find_middle_line", "follow", "move_sheets"]

#: On a middle line the distance's slope is less than this: the nearest walls lie opposite each other (two at
#: 120 degrees have this slope), and its direction is one in so much of the gradients around.
_OPPOSED, _ONE_WAY = 0.5, 0.5
#: What follows turns by no more than this, is no more than so many times as wide, and lies where the line's
#: normal points (the cosine); pixels' steps are forgiven besides.
_TURN_DEG, _WIDER, _SQUARE = 35.0, 2.0, 0.75
#: Followed back, a way ends where it began: within so many pixels and this share of its length.
_BACK_PIXELS, _BACK_SHARE = 3.0, 0.35
#: Ways are averaged over their neighbours (standard deviation, in distances between slices; as many at most),
#: and left out where these differ by more than this share of that distance and of their length.
_AVERAGED, _NEIGHBOURS = 0.4, 24
_ALIKE = (0.25, 0.2)
#: A pixel goes the way of so many of the nearest lines' pixels.
_CLOSEST = 6
#: Sheets are followed so far aside, in distances between slices: fissures of lungs lie at 45 to 65 degrees to
#: the axis.
STEEPEST = 2.2
#: They move all the way where distances that are interpolated as they lie keep less than the first share of
#: their width, not at all where they keep the second: what overlaps itself is interpolated better as it lies.
KEPT = (0.2, 0.5)
#: They are found over so much of two distances between slices along them; vessels at lungs' roots are not.
LEAST_LENGTH = 0.5
#: A sheet that goes on as it came opens into the outside where, so far on, only one of its walls is left, at
#: its half width but for so many pixels and this share of the way.
_WALL_PIXELS, _WALL_SHARE = 1.0, 0.25
#: Ends of ways that are so many pixels away are of the same place of a line.
_SAME_PIXELS = 2.2


@dataclass(frozen=True, eq=False)
class MiddleLine:
    """Pixels in the middle of what is thin on a slice, in the plane's mm.

    Attributes
    ----------
    points : (N, 2) float64
    normals : (N, 2) float64
        Unit vectors towards the walls, either way.
    half_widths : (N,) float64
    """

    points: FloatArray
    normals: FloatArray
    half_widths: FloatArray

    def take(self, chosen: AnyArray) -> MiddleLine:
        """Leave some of them."""
        return MiddleLine(self.points[chosen], self.normals[chosen], self.half_widths[chosen])


@dataclass(frozen=True, eq=False)
class Displacements:
    """Where middle lines go from one slice to the next.

    Attributes
    ----------
    middles : (N, 2) float64
        mm, half way.
    shifts : (N, 2) float64
        mm from the lower slice to the upper one.
    half_widths : (N,) float64
    lost : (N,) float64
        How much of the sheet is lost half way where distances are interpolated as they lie, from 0 to 1.
    signs : (N,) float64
        1 for slits, -1 for plates.
    opens : (N,) float64
        1 where only the lower slice has the sheet, which then opens into the outside (a plate: into the
        inside) on its way up, -1 where only the upper one has it, 0 where both do.
    """

    middles: FloatArray
    shifts: FloatArray
    half_widths: FloatArray
    lost: FloatArray
    signs: FloatArray
    opens: FloatArray

    @property
    def reach(self) -> FloatArray:
        """Distance (N,) in mm from the middle that the moving sheet covers."""
        return np.linalg.norm(self.shifts, axis=1) / 2 + self.half_widths

    def take(self, chosen: AnyArray) -> Displacements:
        """Leave some of them."""
        return Displacements(*(getattr(self, name)[chosen] for name in _COLUMNS))

    def ends(self, way: int) -> FloatArray:
        """Where (N, 2) they end on the upper slice (``way`` 1), or on the lower one (-1)."""
        return self.middles + way * self.shifts / 2


_COLUMNS = tuple(column.name for column in dataclass_fields(Displacements))


def move_sheets(fields: Sequence[LevelField], spacing: FloatArray) -> list[LevelField]:
    """Let thin parts move between the slices.

    Parameters
    ----------
    fields : sequence of LevelField
        Of slices, and interpolated between them.
    spacing : (2,) float64
        mm per pixel.

    Returns
    -------
    list of LevelField
        Those of slices are as they were; so are all where nothing thin has moved by more than its width.
    """
    moved = list(fields)
    slices = [n for n, field in enumerate(fields) if field.source_slice is not None]
    if len(slices) == len(fields):
        return moved
    widest = max(fields[high].z - fields[low].z for low, high in itertools.pairwise(slices))
    sheets = [_Sheets.on(fields[n], spacing, widest) for n in slices]
    gaps = [_Gap.between(low, high, spacing) for low, high in itertools.pairwise(sheets)]
    for g, gap in enumerate(gaps):
        ways = _with_opening(gap, gaps[max(g - 1, 0) : g + 2], spacing)
        around = _around(ways, gap.low.distance.shape, spacing)
        for n in range(slices[g] + 1, slices[g + 1]) if len(around.pixels) else ():
            moved[n] = replace(fields[n], distance=around.moved(fields[n], gap))
    return moved


# middle lines -----------------------------------------------------------------------------------------


def find_middle_line(distance: SingleArray, spacing: FloatArray, widest: float) -> MiddleLine:
    """Find the middle of slits: of what is outside and narrow.

    Parameters
    ----------
    distance : (I, J) float32
        Signed distances in mm, negative inside. Of plates it is that with the other sign.
    spacing : (2,) float64
        mm per pixel.
    widest : float
        Half the width in mm of what is no slit any more.

    Examples
    --------
    A slit three pixels wide between two halves:

    >>> distance = np.float32(2 - np.abs(np.arange(15) - 7))[:, None].repeat(9, axis=1)
    >>> line = find_middle_line(distance, np.ones(2), 5.0)
    >>> np.unique(line.points[:, 0]), np.abs(line.normals[0]).round(6), line.half_widths[0]
    (array([7.]), array([1., 0.]), np.float64(2.0))
    """
    slopes = np.gradient(distance, *spacing)
    middle = (distance > 0) & (distance < widest) & (np.hypot(slopes[0], slopes[1]) < _OPPOSED)
    if not middle.any():
        return MiddleLine(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0))
    products = slopes[0] * slopes[0], slopes[0] * slopes[1], slopes[1] * slopes[1]
    along, across, other = (gaussian_filter(product, 1.0)[middle].astype(float) for product in products)
    angle = np.arctan2(2 * across, along - other) / 2
    one_way = np.hypot(along - other, 2 * across) > _ONE_WAY * (along + other)
    points = np.argwhere(middle) * spacing
    normals = np.column_stack([np.cos(angle), np.sin(angle)])
    return MiddleLine(points[one_way], normals[one_way], distance[middle][one_way].astype(float))


def follow(line: MiddleLine, other: MiddleLine, reach: float, pixel: float) -> tuple[IntArray, IntArray]:
    """Follow a middle line to the nearest one on the next slice that runs in its direction.

    Parameters
    ----------
    line, other : MiddleLine
    reach : float
        Longest way in mm.
    pixel : float
        mm.

    Returns
    -------
    chosen, onto : (M,) int64
        Points of ``line`` that go on in the other, and in which of its points.
    """
    if not (len(line.points) and len(other.points)):
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    here, there = _placed(line, reach), _placed(other, reach)
    onto = np.asarray(cKDTree(there).query(here)[1])
    back = cKDTree(here).query(there[onto])[1]
    way = other.points[onto] - line.points
    length = np.linalg.norm(way, axis=1)
    square = (way * line.normals).sum(axis=1)
    turned = np.abs((line.normals * other.normals[onto]).sum(axis=1))
    widths = np.sort(np.column_stack([line.half_widths, other.half_widths[onto]]), axis=1)
    returned = np.linalg.norm(line.points[back] - line.points, axis=1)
    follows = (
        (length <= reach)
        & (turned >= np.cos(np.radians(_TURN_DEG)))
        & (np.abs(square) >= _SQUARE * length - pixel)
        & (widths[:, 1] <= _WIDER * widths[:, 0] + pixel)
        & (returned <= _BACK_PIXELS * pixel + _BACK_SHARE * length)
    )
    return np.flatnonzero(follows), onto[follows]


def _placed(line: MiddleLine, reach: float) -> FloatArray:
    """Points (N, 4) that are near each other where lines are, in place and in direction."""
    first, second = line.normals.T
    return np.column_stack([line.points, reach * (first**2 - second**2), reach * 2 * first * second])


# between two slices -----------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Sheets:
    """A slice's distances (I, J), and the middle lines of its slits and of its plates."""

    z: float
    distance: SingleArray
    lines: tuple[MiddleLine, MiddleLine]

    @classmethod
    def on(cls, field: LevelField, spacing: FloatArray, widest: float) -> _Sheets:
        """Find both."""
        lines = [find_middle_line(sign * field.distance, spacing, widest) for sign in (1, -1)]
        return cls(field.z, field.distance, (lines[0], lines[1]))


@dataclass(frozen=True, eq=False)
class _Gap:
    """Two slices, the ways between them as their lines are followed one by one, and averaged ones."""

    low: _Sheets
    high: _Sheets
    found: Displacements
    ways: Displacements

    @property
    def height(self) -> float:
        """Distance between the slices in mm."""
        return self.high.z - self.low.z

    @classmethod
    def between(cls, low: _Sheets, high: _Sheets, spacing: FloatArray) -> _Gap:
        """Follow slits and plates from a slice to the next one above and back; leave what is alike."""
        reach, pixel = STEEPEST * (high.z - low.z), float(np.sqrt(spacing.prod()))
        parts: list[Displacements] = []
        for sign, *lines in zip((1, -1), low.lines, high.lines, strict=True):
            for way, (line, other) in zip((1, -1), (lines, lines[::-1]), strict=True):
                chosen, onto = follow(line, other, reach, pixel)
                square = ((other.points[onto] - line.points[chosen]) * line.normals[chosen]).sum(axis=1)
                half_widths = np.minimum(line.half_widths[chosen], other.half_widths[onto])
                taken = replace(line.take(chosen), half_widths=half_widths)
                parts.append(_ways(taken, square, (low, high), spacing, sign, way))
        found = _joined(parts)
        return cls(low, high, found, _averaged(found, high.z - low.z, spacing))


def _ways(
    line: MiddleLine,
    square: FloatArray,
    slices: tuple[_Sheets, _Sheets],
    spacing: FloatArray,
    sign: int,
    way: int,
    opens: int = 0,
) -> Displacements:
    """Ways of a line's points, ``square`` (N,) mm along its normals, up (``way`` 1) or down (-1)."""
    moves = square[:, None] * line.normals
    middles = line.points + moves / 2
    below, above = (sampled(sheets.distance, middles / spacing) for sheets in slices)
    lost = 1 - np.interp(sign * (below + above) / (2 * line.half_widths), KEPT, (0.0, 1.0))
    signs, opening = (np.full(len(square), float(value)) for value in (sign, opens))
    return Displacements(middles, way * moves, line.half_widths, lost, signs, opening)


def _with_opening(gap: _Gap, around: Sequence[_Gap], spacing: FloatArray) -> Displacements:
    """Add the ways of sheets that only one of a gap's slices has, by those before it and after it."""
    opening = [
        _opening(gap, other, spacing) for other in around if other is not gap and len(other.ways.middles)
    ]
    if not any(len(ways.middles) for ways in opening):
        return gap.ways
    # as many as of a line that is followed there and back
    return _averaged(_joined([gap.found, *opening, *opening]), gap.height, spacing)


def _opening(gap: _Gap, beside: _Gap, spacing: FloatArray) -> Displacements:
    """Let sheets that end on a slice go on as they came, where the next slice shows that they open.

    Where a sheet leaves the organ, what lay on one side of it ends, and the wall on its other side becomes
    the outline.
    """
    way = 1 if beside.high is gap.low else -1
    here, there = (gap.low, gap.high) if way > 0 else (gap.high, gap.low)
    pixel = float(np.sqrt(spacing.prod()))
    came, gone = beside.ways.ends(way), gap.found.ends(-way)
    last = spacing * (np.array(there.distance.shape) - 1)
    parts: list[Displacements] = []
    for sign, line in zip((1, -1), here.lines, strict=True):
        away, near = _nearest(came, line.points, 1, _SAME_PIXELS * pixel)
        taken = np.isfinite(_nearest(gone, line.points, 1, _SAME_PIXELS * pixel)[0])
        ends = np.flatnonzero(np.isfinite(away[:, 0]) & ~taken[:, 0])
        line = line.take(ends)
        move = way * gap.height / beside.height * beside.ways.shifts[near[ends, 0]]
        square = (move * line.normals).sum(axis=1)
        onto = line.points + square[:, None] * line.normals
        ahead = np.sign(square)[:, None] * line.normals * pixel
        behind, at, before = (
            sign * sampled(there.distance, (onto + side * ahead) / spacing) for side in (-1, 0, 1)
        )
        off = line.half_widths - at
        opens = np.abs(off) <= _WALL_PIXELS * pixel + _WALL_SHARE * np.abs(square)
        opens &= before - behind > _OPPOSED * 2 * pixel  # there is no other wall
        opens &= np.all((onto >= 0) & (onto <= last), axis=1)
        square += np.sign(square) * off
        parts.append(_ways(line.take(opens), square[opens], (gap.low, gap.high), spacing, sign, way, way))
    return _joined(parts)


def _joined(parts: Sequence[Displacements]) -> Displacements:
    """Join ways of several lines."""
    return Displacements(*(np.concatenate([getattr(ways, name) for ways in parts]) for name in _COLUMNS))


def _averaged(ways: Displacements, gap: float, spacing: FloatArray) -> Displacements:
    """Average ways over their neighbours; leave out what has few within ``gap`` mm, or unlike ones."""
    fewest = LEAST_LENGTH * 4 * gap / float(np.sqrt(spacing.prod()))
    if len(ways.middles) < max(fewest, 1):
        return ways.take(np.zeros(0, np.int64))
    many = cKDTree(ways.middles).query_ball_point(ways.middles, gap, return_length=True) >= fewest
    away, near = _nearest(ways.middles, ways.middles, min(_NEIGHBOURS, len(ways.middles)), gap)
    weight = _summing_to_one(np.exp(-((away / (_AVERAGED * gap)) ** 2) / 2))
    shifts = np.einsum("nk,nkx->nx", weight, ways.shifts[near])
    spread = np.einsum("nk,nk->n", weight, ((ways.shifts[near] - shifts[:, None]) ** 2).sum(axis=2))
    alike = np.sqrt(spread) <= _ALIKE[0] * gap + _ALIKE[1] * np.linalg.norm(ways.shifts, axis=1)
    lost = np.einsum("nk,nk->n", weight, ways.lost[near])
    return replace(ways, shifts=shifts, lost=lost).take(many & alike)


@dataclass(frozen=True, eq=False)
class _Around:
    """Pixels (P, 2) around moving sheets.

    Attributes
    ----------
    pixels : (P, 2) int64
    shifts : (P, 2) float64
        Pixels by which they move.
    weight : (P,) float32
        How much they do.
    passed : (P,) float64
        At which share of the way up the sheet's middle passes the pixel.
    signs, opens : (P,) float32
        As of `Displacements`, and between them.
    """

    pixels: IntArray
    shifts: FloatArray
    weight: SingleArray
    passed: FloatArray
    signs: SingleArray
    opens: SingleArray

    def moved(self, plane: LevelField, gap: _Gap) -> SingleArray:
        """Distances (I, J) of a level between two slices, interpolated along the way."""
        share = (plane.z - gap.low.z) / gap.height
        low = sampled(gap.low.distance, self.pixels - share * self.shifts)
        high = sampled(gap.high.distance, self.pixels + (1 - share) * self.shifts)
        along = np.float32(1 - share) * low + np.float32(share) * high
        distance, at = plane.distance.copy(), tuple(self.pixels.T)
        # what a sheet that opens has not passed yet is interpolated as it lies
        for way, sheet in ((1, low), (-1, high)):
            ahead = np.clip(way * self.opens, 0, 1) * (way * (self.passed - share) > 0)
            beside = self.signs * np.maximum(self.signs * sheet, self.signs * distance[at])
            along += ahead * (beside - along)
        distance[at] += self.weight * (along - distance[at])
        return distance


def _around(ways: Displacements, shape: tuple[int, ...], spacing: FloatArray) -> _Around:
    """Spread ways over the pixels that the sheets cover, and less and less as far again."""
    if not np.any(ways.lost > 0):
        none = np.zeros(0, np.float32)
        return _Around(np.zeros((0, 2), np.int64), np.zeros((0, 2)), none, np.zeros(0), none, none)
    furthest = 2 * float(ways.reach.max())
    first = np.maximum(np.floor((ways.middles.min(axis=0) - furthest) / spacing).astype(int), 0)
    last = np.minimum(np.ceil((ways.middles.max(axis=0) + furthest) / spacing).astype(int), shape)
    pixels = np.argwhere(np.ones(np.maximum(last - first, 0), bool)) + first
    away, near = _nearest(ways.middles, pixels * spacing, _CLOSEST, furthest)
    close = np.isfinite(away[:, 0])
    pixels, away, near = pixels[close], away[close], near[close]
    weight = _summing_to_one(1 / (away + spacing.min() / 2) ** 2)
    columns = (ways.reach, ways.lost, ways.signs, ways.opens)
    reach, lost, signs, opens = (np.einsum("pk,pk->p", weight, values[near]) for values in columns)
    shifts, middles = (
        np.einsum("pk,pkx->px", weight, values[near]) for values in (ways.shifts, ways.middles)
    )
    share: FloatArray = lost * np.clip(2 - away[:, 0] / reach, 0, 1)
    way = ((pixels * spacing - middles) * shifts).sum(axis=1)
    passed = 0.5 + way / np.maximum((shifts**2).sum(axis=1), TINY)
    some = share > 0
    return _Around(
        pixels[some],
        shifts[some] / spacing,
        share[some].astype(np.float32),
        passed[some],
        signs[some].astype(np.float32),
        opens[some].astype(np.float32),
    )


def _nearest(
    points: FloatArray, places: FloatArray, count: int, within: float
) -> tuple[FloatArray, IntArray]:
    """Distances (N, count) from places to the nearest points, infinite beyond ``within``; which they are."""
    if not (len(points) and len(places)):
        return np.full((len(places), count), np.inf), np.zeros((len(places), count), np.int64)
    away, near = map(
        np.asarray, cKDTree(points).query(places, range(1, count + 1), distance_upper_bound=within)
    )
    return away, np.minimum(near, len(points) - 1)


def _summing_to_one(weight: FloatArray) -> FloatArray:
    """Weights (N, K) of each row by their sum."""
    return weight / weight.sum(axis=1, keepdims=True)
