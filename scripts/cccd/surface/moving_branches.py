"""Branches thinner than the way they move aside from slice to slice: vessels, airways, ducts.

Where a branch runs aslant its sections on two slices hardly overlap, and distances that are interpolated
pixel by pixel leave a chain of pearls. So sections are followed from slice to slice, and between the slices
they are moved along the line through their centres. A section tells the line's slope by itself: a plane cuts
a round branch that leans by an angle in an ellipse, longer by one over its cosine, the way it leans.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from cccd.bands import Slices
from cccd.geometry.arrays import BoolArray, FloatArray, IntArray, SingleArray
from cccd.geometry.distance import to_mask
from cccd.surface.distances import distance_to_part, sampled

#: mm: levels so near to a slice are the slice's own.
SAME_HEIGHT = 1e-6
#: A section's way may differ from what its ellipse tells by this share of its length, and by so many pixels;
#: and of two sections that are moved one is no more than so many times as long that way, but for a pixel.
_OFF_COURSE, _OFF_PIXELS, _LONGER = 0.5, 2.0, 2.0
#: What overlaps nothing follows what lies so near beside it, whatever its ellipse tells (share of the
#: distance between slices): at twice that, bends of the colon and bronchi are joined to other parts.
_BESIDE = 0.25
#: Pixels count as the branch's own where they are so much nearer to it than to all else, in pixels.
_OWN_PIXELS = 4.0
#: What is moved is known so many pixels around the sections.
_MARGIN = 6
#: Branches are followed so far aside, in distances between slices: at 72 degrees to the axis. What lies
#: nearer to the slices' plane shows on one slice as a whole.
STEEPEST = 3.0
#: Sections are not moved where they move aside by less than so many of their half widths along the way, and
#: all the way where they move by more: distances that are interpolated as they lie keep .85 and .6 of a disc.
ASIDE = (1.0, 1.6)


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

    def misses(self, part: IntArray, way: FloatArray, gap: float) -> FloatArray:
        """How many mm (...) a way (..., 2) over a ``gap`` in mm is off what sections tell."""
        lean = self.leans[part] * gap
        return np.minimum(np.linalg.norm(way - lean, axis=-1), np.linalg.norm(way + lean, axis=-1))

    def reaches(self, part: IntArray, way: FloatArray) -> FloatArray:
        """Half widths (P,) in mm of parts (P,) along ways (P, 2)."""
        along = np.einsum("pc,pc->p", self.leans[part], way) / np.maximum(np.linalg.norm(way, axis=1), 1e-9)
        return self.half_widths[part] * np.hypot(1, along)

    def of_part(self, part: int, window: tuple[slice, slice], spacing: FloatArray) -> SingleArray:
        """Distances in mm within a window to one part; of part -1, to all."""
        labels, distance = self.labels[window], self.distance[window]
        return distance if part < 0 else distance_to_part(distance, labels, part + 1, spacing)


@dataclass(frozen=True, eq=False)
class Displacement:
    """How a branch runs between two slices.

    Attributes
    ----------
    low, high : int
        Its sections; -1 where it leads into what is larger.
    shift : (2,) float64
        mm from its middle on the lower slice to that on the upper one.
    share : float
        How far its sections are moved, from 0 (interpolated as they lie) to 1.
    """

    low: int
    high: int
    shift: FloatArray
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
        followed = follow_branches(sections, spacing, into_larger=sign > 0)
        for between, gap, ways in zip(gaps, _gaps_of(sections), followed, strict=True):
            levels = np.float32(sign) * moved[between]
            for way in ways:
                _unite(levels, z[between], gap, way, spacing)
            moved[between] = np.float32(sign) * levels
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
        that is no branch itself.

    Returns
    -------
    list of lists of Displacement
        Gap by gap, those that are moved.
    """
    gaps = _gaps_of(sections)
    pairs = [gap.pairs(float(np.sqrt(spacing.prod()))) for gap in gaps]
    ways: list[list[Displacement]] = []
    for n, gap in enumerate(gaps):
        found = [way for way in pairs[n] if way.share > 0]
        for up, beyond in ((False, n - 1), (True, n + 1)) if into_larger else ():
            alone = gap.free(up)
            if 0 <= beyond < len(gaps):
                alone &= gaps[beyond].free(not up)
            followed = [way.high if up else way.low for way in pairs[n]]
            for part in np.setdiff1d(np.flatnonzero(alone), followed).tolist():
                found += gap.leading_into_larger(part, up, spacing)
        ways.append(found)
    return ways


def _gaps_of(sections: Sequence[SliceParts]) -> list[SliceGap]:
    """Give the gaps between neighbours."""
    return [SliceGap.between(low, high) for low, high in itertools.pairwise(sections)]


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

    def pairs(self, pixel: float) -> list[Displacement]:
        """Parts that run on in each other, and in nothing else; a ``pixel`` is so many mm."""
        single = [np.bincount(side, minlength=1)[side] == 1 for side in self.touching.T]
        alone = self.touching[single[0] & single[1]]
        free = self._nearest_free(pixel)
        course = self._on_course(alone[:, 0], alone[:, 1], pixel)
        follows: BoolArray = np.concatenate([course, np.ones(len(free), np.bool_)])
        a, b = np.concatenate([alone, free]).T
        shift = self.above.centres[b] - self.below.centres[a]
        thick = np.maximum(self.below.half_widths[a], self.above.half_widths[b]) > self.height
        reach = np.array([self.below.reaches(a, shift), self.above.reaches(b, shift)])
        alike = reach.max(axis=0) <= _LONGER * reach.min(axis=0) + pixel
        moves = follows & alike & ~thick & self.below.within[a] & self.above.within[b]
        aside = np.linalg.norm(shift, axis=1) / reach.mean(axis=0)
        moved: FloatArray = np.asarray(np.interp(aside, ASIDE, (0.0, 1.0)), float)
        share = np.where(moves, moved, 0.0)
        return [Displacement(*way) for way in zip(a.tolist(), b.tolist(), shift, share.tolist(), strict=True)]

    def _off(self, a: IntArray, b: IntArray) -> tuple[FloatArray, FloatArray]:
        """How many mm (...) the ways between parts are off what the ellipses of both tell."""
        way = self.above.centres[b] - self.below.centres[a]
        return self.below.misses(a, way, self.height), self.above.misses(b, way, self.height)

    def _on_course(self, a: IntArray, b: IntArray, pixel: float) -> BoolArray:
        """Whether parts (...) lie where the ellipses of both tell."""
        length = np.linalg.norm(self.above.centres[b] - self.below.centres[a], axis=-1)
        return np.maximum(*self._off(a, b)) <= _OFF_COURSE * length + _OFF_PIXELS * pixel

    def _nearest_free(self, pixel: float) -> IntArray:
        """Pairs (P, 2) of parts that overlap nothing, and lie where both ellipses tell or side by side."""
        low, high = np.flatnonzero(self.free(False)), np.flatnonzero(self.free(True))
        if not (len(low) and len(high)):
            return np.zeros((0, 2), np.int64)
        a, b = low[:, None], high[None]
        length = np.linalg.norm(self.above.centres[b] - self.below.centres[a], axis=-1)
        beside = length - self.below.half_widths[a] - self.above.half_widths[b] <= _BESIDE * self.height
        follows = (length <= STEEPEST * self.height) & (self._on_course(a, b, pixel) | beside)
        off = np.where(follows, sum(self._off(a, b)), np.inf)
        best = off.argmin(axis=1)
        mutual = follows[np.arange(len(low)), best] & (off.argmin(axis=0)[best] == np.arange(len(low)))
        return np.column_stack([low[mutual], high[best[mutual]]])

    def leading_into_larger(self, part: int, up: bool, spacing: FloatArray) -> list[Displacement]:
        """Find the way of a thin part that leans, if it leads into the other slice one way up alone."""
        side, other = (self.above, self.below) if up else (self.below, self.above)
        lean, width = side.leans[part], side.half_widths[part]
        steep = float(np.linalg.norm(lean))
        if width > min(self.height, steep * self.height) or steep > STEEPEST:
            return []
        shifts = np.array([lean, -lean]) * self.height
        ends = side.centres[part] + (-shifts if up else shifts)
        hits = sampled(other.distance, ends / spacing) < 0
        if hits.sum() != 1:
            return []
        hit = int(np.argmax(hits))
        return [Displacement(-1 if up else part, part if up else -1, shifts[hit], 1.0)]


# between two slices -----------------------------------------------------------------------------------


def _unite(
    levels: SingleArray, heights: FloatArray, gap: SliceGap, way: Displacement, spacing: FloatArray
) -> None:
    """Write a branch that runs from slice to slice into levels (L, I, J) at heights (L,) between them."""
    ends = (gap.below, way.low), (gap.above, way.high)
    boxes = [side.boxes[part] for side, part in ends if part >= 0]
    if len(boxes) == 1:  # it ends where its way does
        moved = way.shift / spacing * (-1 if way.low < 0 else 1)
        boxes.append(boxes[0] + np.rint(moved).astype(np.int64))
    first = np.maximum(np.min(boxes, axis=0)[0] - _MARGIN, 0)
    last = np.max(boxes, axis=0)[1] + _MARGIN
    window = slice(first[0], last[0]), slice(first[1], last[1])
    lower, upper = (side.of_part(part, window, spacing) for side, part in ends)
    others = np.zeros(lower.shape, np.bool_)
    for side, part in ends:
        there = side.labels[window]
        others |= (there > 0) & (there != part + 1)
    # where pixels are so much nearer to the branch than to all else, its distances alone count
    own = np.ones(lower.shape, np.float32)
    if others.any():
        nearer = to_mask(others, spacing) - np.minimum(lower, upper)
        own = np.clip(nearer / (_OWN_PIXELS * np.float32(spacing.min())), 0, 1)
    straight = way.shift / gap.height
    start, end = (
        straight if part < 0 else np.copysign(1, side.leans[part] @ straight) * side.leans[part]
        for side, part in ends
    )
    for distance, t in zip(levels[:, *window], (heights - gap.below.z) / gap.height, strict=True):
        path = t * t * (3 - 2 * t) * way.shift + gap.height * t * (1 - t) * ((1 - t) * start - t * end)
        low, high = _moved(lower, path / spacing), _moved(upper, (path - way.shift) / spacing)
        branch = np.float32(1 - t) * low + np.float32(t) * high
        either = np.minimum(distance, branch)
        distance += np.float32(way.share) * (either + own * (branch - either) - distance)


def _moved(plane: SingleArray, by: FloatArray) -> SingleArray:
    """Move a plane (I, J) by pixels (2,)."""
    return np.asarray(scipy.ndimage.shift(plane, by, np.float32, order=1, mode="nearest"))
