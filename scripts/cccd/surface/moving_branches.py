"""Branches thinner than the way they move aside from slice to slice: vessels, airways, ducts.

Where a branch runs aslant its sections on two slices hardly overlap, and distances that are interpolated
pixel by pixel leave a chain of pearls. So sections are followed from slice to slice along the branch's centre
line, and between the slices they are moved along it. A section tells the line's slope by itself: a plane cuts
a round branch that leans by an angle in an ellipse, longer by one over its cosine, the way it leans.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from cccd.bands import Slices
from cccd.geometry.arrays import BoolArray, FloatArray, IntArray, SingleArray
from cccd.geometry.distance import to_mask
from cccd.surface.distances import distance_to_part, sampled

#: mm: levels so near to a slice are the slice's own.
SAME_HEIGHT = 1e-6
#: A section's way may differ from what its ellipse tells by this share of its length, and by so many pixels;
#: and of two sections that follow each other one is no more than so many times as wide, but for a pixel.
_OFF_COURSE, _OFF_PIXELS, _WIDER = 0.5, 2.0, 2.0
#: What overlaps nothing follows what lies so near beside it, whatever its ellipse tells (share of the
#: distance between slices): at twice that, bends of the colon and bronchi are joined to other parts.
_BESIDE = 0.25
#: They are moved where that makes up for so much of what they do not share: not at all at the first.
_MADE_UP = (0.3, 0.7)
#: Lengths by which a way that the ellipse tells is tried for what it leads into.
_LENGTHS = np.array([1.0, 0.85, 1.15, 0.7, 1.3])
#: Costs of pairs that no ellipse tells, and of ones that are none.
_ANYTHING_NEARER, _NEVER = 1e4, 1e9
#: Pixels count as the branch's own where they are so much nearer to it than to all else, in pixels.
_OWN_PIXELS = 4.0
#: What is moved is known so many pixels around the sections.
_MARGIN = 6
#: Branches are followed so far aside, in distances between slices: at 72 degrees to the axis. What lies
#: nearer to the slices' plane shows on one slice as a whole.
STEEPEST = 3.0
#: They move all the way where distances that are interpolated as they lie keep less than the first share of
#: their area half way, not at all where they keep the second: what a disc keeps that moves by 1.6, 1.0 radii.
KEPT = (0.6, 0.85)


@dataclass(frozen=True, eq=False)
class SliceParts:
    """Connected parts of a slice, and the ellipses that have their second moments.

    Attributes
    ----------
    z : float
        Height in mm.
    distance : (I, J) float32
        Signed distances in mm, negative inside the parts.
    labels : (I, J) int64
        n + 1 in part n, 0 outside.
    boxes : (N, 2, 2) int64
        First pixel of each part, and the one after its last.
    centres : (N, 2) float64
        mm.
    leans : (N, 2) float64
        mm aside for every mm along z by which a round branch with this section leans, one way or the other.
    half_widths : (N,) float64
        Smaller half axis in mm.
    """

    z: float
    distance: SingleArray
    labels: IntArray
    boxes: IntArray
    centres: FloatArray
    leans: FloatArray
    half_widths: FloatArray

    @classmethod
    def of(cls, distance: SingleArray, spacing: FloatArray, z: float = 0.0) -> SliceParts:
        """Find the parts of a slice.

        Examples
        --------
        >>> i, j = np.indices((21, 31)) - np.array([10, 15])[:, None, None]
        >>> parts = SliceParts.of(np.float32(np.hypot(i, j / 2) - 5.5), np.ones(2))
        >>> parts.half_widths.round(1), np.abs(parts.leans).round(1)  # twice as long: at 60 degrees
        (array([5.5]), array([[0. , 1.7]]))
        """
        found, count = scipy.ndimage.label(distance < 0)
        labels = np.asarray(found, np.int64)
        boxes = [[[side.start, side.stop] for side in box] for box in scipy.ndimage.find_objects(labels)]
        i, j = np.nonzero(labels)
        part = labels[i, j] - 1
        covered = np.clip(0.5 - distance[i, j] / np.sqrt(spacing.prod()), 0, 1)  # share of a pixel
        size = np.bincount(part, covered, count)
        x, y, xx, yy, xy = (
            np.bincount(part, covered * values, count) / size for values in (i, j, i * i, j * j, i * j)
        )
        xx, yy = (xx - x * x + 1 / 12) * spacing[0] ** 2, (yy - y * y + 1 / 12) * spacing[1] ** 2
        xy = (xy - x * y) * spacing.prod()
        half, along = np.hypot((xx - yy) / 2, xy), np.arctan2(2 * xy, xx - yy) / 2
        smaller = (xx + yy) / 2 - half
        slope = np.sqrt(2 * half / smaller)
        return cls(
            z,
            distance,
            labels,
            np.array(boxes, np.int64).reshape(-1, 2, 2).swapaxes(1, 2),
            np.column_stack([x, y]) * spacing,
            slope[:, None] * np.column_stack([np.cos(along), np.sin(along)]),
            2 * np.sqrt(smaller),
        )

    @property
    def within(self) -> BoolArray:
        """Which parts (N,) do not reach the border of the slice's field."""
        inside = (self.boxes[:, 0] > 0) & (self.boxes[:, 1] < self.labels.shape)
        return inside[:, 0] & inside[:, 1]

    def misses(self, part: IntArray | int, way: FloatArray, gap: float) -> FloatArray:
        """How many mm (...) a way (..., 2) over a ``gap`` in mm is off what sections tell."""
        lean = self.leans[part] * gap
        return np.minimum(np.linalg.norm(way - lean, axis=-1), np.linalg.norm(way + lean, axis=-1))

    def of_part(self, part: int, window: _Window, spacing: FloatArray) -> SingleArray:
        """Distances in mm within a window to one part; of part -1, to all."""
        labels, distance = self.labels[window.slices], self.distance[window.slices]
        return distance if part < 0 else distance_to_part(distance, labels, part + 1, spacing)


@dataclass(frozen=True, eq=False)
class Displacement:
    """How a branch runs between two slices.

    Attributes
    ----------
    low, high : int
        Its sections; -1 where it leads into what is larger.
    start : (2,) float64
        Its middle on the lower slice, in mm.
    shift : (2,) float64
        mm from there to its middle on the upper slice.
    turn : float
        Radians by which the direction turns in which it leans.
    share : float
        How far its sections are moved, from 0 (interpolated as they lie) to 1.
    """

    low: int
    high: int
    start: FloatArray
    shift: FloatArray
    turn: float
    share: float


def levels_between(z: FloatArray, heights: FloatArray) -> list[IntArray]:
    """Numbers of the levels at heights (L,) between each two neighbours of slices at heights (S,)."""
    return [
        np.flatnonzero((z > low + SAME_HEIGHT) & (z < high - SAME_HEIGHT))
        for low, high in itertools.pairwise(heights)
    ]


def move_branches(z: FloatArray, values: SingleArray, slices: Slices) -> SingleArray:
    """Let thin branches, and thin cavities, run on between the slices.

    Parameters
    ----------
    z : (L,) float64
        Heights of levels in mm, ascending.
    values : (L, I, J) float32
        Distances in mm on them.
    slices : Slices
        As they were drawn.

    Returns
    -------
    (L, I, J) float32
        Levels between the slices are moved where a thin branch moves by more than its width.
    """
    gaps = levels_between(z, slices.z)
    if not any(map(len, gaps)):
        return values
    moved, spacing = values.copy(), slices.spacing
    for sign in (1, -1):
        if sign < 0 and all(scipy.ndimage.label(plane > 0)[1] == 1 for plane in slices.distance):
            break  # no slice has a cavity
        sections = [
            SliceParts.of(np.float32(sign) * plane, spacing, float(height))
            for plane, height in zip(slices.distance, slices.z, strict=True)
        ]
        ways = follow_branches(sections, spacing, into_larger=sign > 0)
        slopes = _slopes(sections, ways)
        for gap, between in enumerate(gaps):
            for way in ways[gap]:
                branch = _Branch.between(sections[gap], sections[gap + 1], way, slopes[gap], spacing)
                for n in between:
                    here = moved[n][branch.window.slices]
                    here[:] = sign * branch.united(sign * here, float(z[n]))
    return moved


# ways -------------------------------------------------------------------------------------------------


def follow_branches(
    sections: Sequence[SliceParts], spacing: FloatArray, into_larger: bool = True
) -> list[list[Displacement]]:
    """Follow sections from each slice to the next.

    Parameters
    ----------
    sections : sequence of SliceParts
        Slice by slice.
    spacing : (2,) float64
        mm per pixel.
    into_larger : bool
        Whether a section that neither slice beside it overlaps may lead, as its ellipse tells, into a part
        that is no branch itself. Others do so if the next slice tells their direction.

    Returns
    -------
    list of lists of Displacement
        Gap by gap, those that are moved.
    """
    gaps = [SliceGap.between(low, high) for low, high in itertools.pairwise(sections)]
    pairs = [gap.pairs(spacing) for gap in gaps]
    ways: list[list[Displacement]] = []
    for n, gap in enumerate(gaps):
        found = [way for way in pairs[n] if way.share > 0]
        for up in (False, True):
            beyond = n + 1 if up else n - 1
            free = gap.free(up)
            known, alone = dict[int, FloatArray](), free
            if 0 <= beyond < len(gaps):
                known = {
                    way.low if up else way.high: way.shift / gaps[beyond].height for way in pairs[beyond]
                }
                alone = free & gaps[beyond].free(not up)
            followed = [way.high if up else way.low for way in pairs[n]]
            for part in np.setdiff1d(np.flatnonzero(free), followed).tolist():
                shifts = _shifts(gap, part, up, known, bool(alone[part]) and into_larger)
                found += gap.leading_into_larger(part, up, shifts, spacing)
        ways.append(found)
    return ways


def _shifts(gap: SliceGap, part: int, up: bool, known: Mapping[int, FloatArray], alone: bool) -> FloatArray:
    """Ways (W, 2) in mm, upwards, that a part without a follower may have come: as it runs on, or leans."""
    side = gap.above if up else gap.below
    if side.half_widths[part] > gap.height:
        return np.zeros((0, 2))
    if part in known:
        return known[part][None] * gap.height
    lean = side.leans[part]
    steep = float(np.linalg.norm(lean))
    if not alone or steep * gap.height < side.half_widths[part] or steep > STEEPEST:
        return np.zeros((0, 2))
    return np.array([lean, -lean]) * gap.height


@dataclass(frozen=True, eq=False)
class SliceGap:
    """Two neighbouring slices, and the pairs (T, 2) of their parts that overlap."""

    below: SliceParts
    above: SliceParts
    touching: IntArray

    @classmethod
    def between(cls, below: SliceParts, above: SliceParts) -> SliceGap:
        """Find what overlaps."""
        both = (below.labels > 0) & (above.labels > 0)
        count = len(above.centres)
        pairs = np.bincount((below.labels[both] - 1) * count + above.labels[both] - 1)
        return cls(below, above, np.column_stack(np.divmod(np.flatnonzero(pairs), max(count, 1))))

    @property
    def height(self) -> float:
        """Distance in mm."""
        return self.above.z - self.below.z

    def free(self, up: bool) -> BoolArray:
        """Which parts (N,) of the upper or lower slice overlap nothing, and lie within it."""
        side = self.above if up else self.below
        return side.within & (np.bincount(self.touching[:, int(up)], minlength=len(side.centres)) == 0)

    def pairs(self, spacing: FloatArray) -> list[Displacement]:
        """Parts that run on in each other, and in nothing else."""
        pixel = float(np.sqrt(spacing.prod()))
        single = [np.bincount(side, minlength=1)[side] == 1 for side in self.touching.T]
        alone = self.touching[single[0] & single[1]]
        followed = self._on_course(alone[:, 0], alone[:, 1], pixel)
        ways = [
            self._way(a, b, told, spacing)
            for (a, b), told in zip(alone.tolist(), followed.tolist(), strict=True)
        ]
        return ways + [self._way(a, b, True, spacing) for a, b in self._nearest_free(pixel).tolist()]

    def _off(self, a: IntArray, b: IntArray, way: FloatArray) -> tuple[FloatArray, FloatArray]:
        """How many mm (...) ways (..., 2) between parts are off what the ellipses of both tell."""
        return self.below.misses(a, way, self.height), self.above.misses(b, way, self.height)

    def _on_course(self, a: IntArray, b: IntArray, pixel: float) -> BoolArray:
        """Whether parts (...) lie where the ellipses of both tell."""
        way = self.above.centres[b] - self.below.centres[a]
        allowed = _OFF_COURSE * np.linalg.norm(way, axis=-1) + _OFF_PIXELS * pixel
        return np.maximum(*self._off(a, b, way)) <= allowed

    def _nearest_free(self, pixel: float) -> IntArray:
        """Pairs (P, 2) of parts that overlap nothing, and lie where both ellipses tell or side by side."""
        low, high = np.flatnonzero(self.free(False)), np.flatnonzero(self.free(True))
        if not (len(low) and len(high)):  # most masks: they need no scipy.optimize
            return np.zeros((0, 2), np.int64)
        a, b = low[:, None], high[None]
        way = self.above.centres[b] - self.below.centres[a]
        length = np.linalg.norm(way, axis=-1)
        widths = self.below.half_widths[a], self.above.half_widths[b]
        apart = length - widths[0] - widths[1]
        told = self._on_course(a, b, pixel)
        follows = (
            (length <= STEEPEST * self.height)
            & (told | (apart <= _BESIDE * self.height))
            & (np.maximum(*widths) <= _WIDER * np.minimum(*widths) + pixel)
        )
        cost = np.where(told, sum(self._off(a, b, way)), _ANYTHING_NEARER + apart)
        rows, columns = scipy.optimize.linear_sum_assignment(np.where(follows, cost, _NEVER))
        chosen = follows[rows, columns]
        return np.column_stack([low[rows[chosen]], high[columns[chosen]]])

    def _way(self, a: int, b: int, follows: bool, spacing: FloatArray) -> Displacement:
        """How far two sections are moved onto each other; not at all if they do not follow."""
        start, lean = self.below.centres[a], self.below.leans[a]
        shift, onto = self.above.centres[b] - start, self.above.leans[b]
        way = Displacement(a, b, start, shift, _angle(_along(lean, shift), _along(onto, shift)), 0.0)
        thick = max(self.below.half_widths[a], self.above.half_widths[b]) > self.height
        if thick or not follows or not (self.below.within[a] and self.above.within[b]):
            return way
        window = _Window.around([self.below.boxes[a], self.above.boxes[b]], self.below.labels.shape, spacing)
        lower = self.below.of_part(a, window, spacing)
        upper = self.above.of_part(b, window, spacing)
        sizes = np.count_nonzero(lower < 0) * np.count_nonzero(upper < 0)
        kept = np.count_nonzero(lower + upper < 0) / sizes**0.5
        shared = _overlap(lower < 0, upper < 0)
        matched = _overlap(window.moved(lower, start, start + shift, way.turn) < 0, upper < 0)
        made_up = float(np.interp((matched - shared) / max(1 - shared, 1e-9), _MADE_UP, (0.0, 1.0)))
        lost = 1 - float(np.interp(kept, KEPT, (0.0, 1.0)))
        return replace(way, share=made_up * lost)

    def leading_into_larger(
        self, part: int, up: bool, shifts: FloatArray, spacing: FloatArray
    ) -> Iterator[Displacement]:
        """Yield the way of a part, if just one of ``shifts`` (W, 2) leads into a part of the other slice."""
        side, other = (self.above, self.below) if up else (self.below, self.above)
        hits: list[FloatArray] = []
        for shift in shifts:
            tried = shift * _LENGTHS[:, None]
            inside = sampled(other.distance, (side.centres[part] + (-tried if up else tried)) / spacing) < 0
            hits += [tried[np.argmax(inside)]] if inside.any() else []
        if len(hits) == 1:
            start = side.centres[part] - hits[0] if up else side.centres[part]
            yield Displacement(-1 if up else part, part if up else -1, start, hits[0], 0.0, 1.0)


def _along(lean: FloatArray, shift: FloatArray) -> FloatArray:
    """Point a lean (2,), which says which way up to its sign, the way of a shift (2,)."""
    return lean if lean @ shift >= 0 else -lean


def _angle(first: FloatArray, second: FloatArray) -> float:
    """Radians from one vector (2,) to another."""
    return float(np.arctan2(first[0] * second[1] - first[1] * second[0], first @ second))


def _overlap(first: BoolArray, second: BoolArray) -> float:
    """Pixels that two share by those of either."""
    return np.count_nonzero(first & second) / np.count_nonzero(first | second)


# between two slices -----------------------------------------------------------------------------------

#: A way's slopes in mm per mm on the lower and the upper slice.
_Slopes = tuple[FloatArray, FloatArray]


def _slopes(
    sections: Sequence[SliceParts], ways: Sequence[Sequence[Displacement]]
) -> list[dict[Displacement, _Slopes]]:
    """Slopes of every gap's ways: where a branch runs on, the mean of both sides'."""
    rates = [
        {way: way.shift / (above.z - below.z) for way in here}
        for (below, above), here in zip(itertools.pairwise(sections), ways, strict=True)
    ]
    ending = [{way.high: rate for way, rate in here.items() if way.high >= 0} for here in rates]
    beginning = [{way.low: rate for way, rate in here.items() if way.low >= 0} for here in rates]
    before, after = [{}, *ending[:-1]], [*beginning[1:], {}]
    return [
        {
            way: ((rate + before[n].get(way.low, rate)) / 2, (rate + after[n].get(way.high, rate)) / 2)
            for way, rate in here.items()
        }
        for n, here in enumerate(rates)
    ]


@dataclass(frozen=True, eq=False)
class _Branch:
    """A branch between two slices, within a window: distances to it on both, and the path of its middle.

    ``own`` (I, J), from 0 to 1, tells how much nearer pixels are to it than to all else: where it is 1 the
    branch's distances alone count.
    """

    window: _Window
    lower: SingleArray
    upper: SingleArray
    own: SingleArray
    way: Displacement
    slopes: _Slopes
    z: tuple[float, float]

    @classmethod
    def between(
        cls,
        below: SliceParts,
        above: SliceParts,
        way: Displacement,
        slopes: Mapping[Displacement, _Slopes],
        spacing: FloatArray,
    ) -> _Branch:
        """Cut a window out of both slices."""
        ends = (below, way.low), (above, way.high)
        boxes = [side.boxes[part] for side, part in ends if part >= 0]
        if len(boxes) == 1:  # it ends where its way does
            moved = way.shift / spacing * (-1 if way.low < 0 else 1)
            boxes.append(boxes[0] + np.rint(moved).astype(np.int64))
        window = _Window.around(boxes, below.labels.shape, spacing)
        lower, upper = (side.of_part(part, window, spacing) for side, part in ends)
        others = np.zeros(lower.shape, np.bool_)
        for side, part in ends:
            there = side.labels[window.slices]
            others |= (there > 0) & (there != part + 1)
        own = np.ones(lower.shape, np.float32)
        if others.any():
            nearer = to_mask(others, spacing) - np.minimum(lower, upper)
            own = np.clip(nearer / (_OWN_PIXELS * np.float32(spacing.min())), 0, 1)
        return cls(window, lower, upper, own, way, slopes[way], (below.z, above.z))

    def united(self, distance: SingleArray, z: float) -> SingleArray:
        """Distances of the window, on a level at height ``z``, with the branch in them."""
        gap = self.z[1] - self.z[0]
        t = (z - self.z[0]) / gap
        first, last = self.slopes
        way = self.way
        path = t * t * (3 - 2 * t) * way.shift + gap * t * (1 - t) * ((1 - t) * first - t * last)
        middle = way.start + path
        low = self.window.moved(self.lower, way.start, middle, t * way.turn)
        high = self.window.moved(self.upper, way.start + way.shift, middle, (t - 1) * way.turn)
        branch = np.float32(1 - t) * low + np.float32(t) * high
        either = np.minimum(distance, branch)
        alone = either + self.own * (branch - either)
        united = distance + np.float32(way.share) * (alone - distance)
        return np.asarray(united, np.float32)


@dataclass(frozen=True, eq=False)
class _Window:
    """A rectangle of a slice's pixels, and mm per pixel (2,)."""

    slices: tuple[slice, slice]
    spacing: FloatArray

    @classmethod
    def around(cls, boxes: Sequence[IntArray], shape: Sequence[int], spacing: FloatArray) -> _Window:
        """Bound some boxes (2, 2), with a margin, within a slice."""
        first = np.maximum(np.min(boxes, axis=0)[0] - _MARGIN, 0)
        last = np.minimum(np.max(boxes, axis=0)[1] + _MARGIN, shape)
        return cls((slice(int(first[0]), int(last[0])), slice(int(first[1]), int(last[1]))), spacing)

    def moved(self, plane: SingleArray, start: FloatArray, end: FloatArray, turn: float) -> SingleArray:
        """Move a window's plane (I, J) from ``start`` to ``end`` (2,) in mm and turn it there by radians."""
        first = np.array([self.slices[0].start, self.slices[1].start])
        away = (np.indices(plane.shape).reshape(2, -1).T + first) * self.spacing - end
        cosine, sine = np.cos(turn), np.sin(turn)
        back = start + away @ np.array([[cosine, -sine], [sine, cosine]])
        return sampled(plane, back / self.spacing - first).reshape(plane.shape)
