"""Parts that end between two slices: a rounded end in the distances.

Interpolated distances close such a part at once, on a level that depends on how far away its neighbours are.
Near its pole the section of any smooth body falls linearly with height, as a paraboloid's does; so how fast
the square of its width falls from slice to slice says how far the part goes.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, cast

import numpy as np
from scipy import ndimage

from cccd.geometry.arrays import BoolArray, FloatArray, IntArray, SingleArray
from cccd.surface.fields import LevelField
from cccd.surface.undrawn import GuideLine

__all__ = ["round_ends"]

#: A part goes on beyond its last slice by these shares of the distance between slices, at least and at most:
#: at the next slice there is none of it.
LOWEST, HIGHEST = 0.2, 0.9
#: An end is at most so many times as high as the part is deep: its largest distance inside. The first holds
#: where only one slice shows the part, so that nothing says how it tapers.
ROUND, SLENDER = 1.5, 4.0
#: Levels beyond the last slice reach this many times as far as the highest end.
BEYOND = 1.5


@dataclass(frozen=True, eq=False)
class _Ends:
    """What ends on one slice, towards the next: parts of which none lies there.

    Attributes
    ----------
    own : (I, J) float32
        Signed distance in mm to what ends.
    nearest : (I, J) bool
        Pixels that are nearer to what ends than to what goes on.
    depth, height : (I, J) float32
        Of the nearest of them: its largest distance inside, and how far it goes on, both in mm.
    """

    own: SingleArray
    nearest: BoolArray
    depth: SingleArray
    height: SingleArray

    @classmethod
    def of(
        cls,
        plane: SingleArray,
        drawn: SingleArray,
        before: SingleArray | None,
        between: Sequence[SingleArray],
        spacing: FloatArray,
        step: float,
        rise: Callable[[BoolArray], float | None] | None,
    ) -> _Ends | None:
        """Find the parts of a plane that do not reach the next; None without any.

        ``drawn`` and ``before`` are the slice and the one before as they were drawn, which tells the heights;
        ``between`` are the levels up to the next slice, itself the last; none beyond the last slice. ``rise``
        gives the height of a part's end in mm, or None, where planes across were drawn.
        """
        after = between[-1] if between else None
        parts, count = _parts(plane < 0)
        goes_on = np.zeros(count + 1, np.bool_)
        goes_on[0] = True
        if after is not None:
            goes_on[np.unique(parts[after < 0])] = True
            if not goes_on.all():
                goes_on[_reaching(parts, between)] = True
        goes_on[np.unique(np.concatenate([parts[[0, -1]].ravel(), parts[:, [0, -1]].ravel()]))] = True
        ended = ~goes_on[parts]
        if not ended.any():
            return None
        away, nearest = _away(ended, spacing)
        own = np.where(ended, plane, np.maximum(away, np.abs(plane))).astype(np.float32)
        stays = (parts > 0) & ~ended
        if after is not None:
            stays |= after < 0
        other = ndimage.distance_transform_edt(~stays, sampling=spacing) if stays.any() else np.inf
        endings, number = _parts(ended)
        depth, known = (
            -np.asarray(ndimage.minimum(values, endings, np.arange(number + 1)), np.float64)
            for values in (plane, drawn)
        )
        height = _heights(endings, number, before, known, step)
        if rise is not None:
            for n in range(1, number + 1):
                if (seen := rise(endings == n)) is not None:
                    height[n] = seen
        which = endings[nearest]
        return cls(
            own,
            own < other,
            depth[which].astype(np.float32),
            height[which].astype(np.float32),
        )

    def on(self, level: SingleArray, rise: float) -> SingleArray:
        """Put the ends into interpolated distances (I, J) on a level ``rise`` mm beyond the slice.

        Within the outline the square of the distance from the part's middle falls linearly with height. The
        result is zero on the end, linear in height, and no distance.
        """
        within = np.minimum(self.own, 0)
        end = self.own + within**2 / (2 * self.depth) + self.depth / 2 * rise / self.height
        return np.where(self.nearest, end, level).astype(np.float32)


def _reaching(parts: IntArray, between: Sequence[SingleArray]) -> IntArray:
    """Which parts (I, J) of a plane are joined to the last of the levels above it."""
    inside = np.stack([parts > 0, *(level < 0 for level in between)])
    joined, _ = _parts(inside)
    return np.unique(parts[np.isin(joined[0], joined[-1][joined[-1] > 0])])


def _parts(inside: BoolArray) -> tuple[IntArray, int]:
    parts = np.zeros(inside.shape, np.int64)
    count = ndimage.label(inside, output=parts)
    return parts, int(cast(Any, count))


def _away(mask: BoolArray, spacing: FloatArray) -> tuple[FloatArray, tuple[IntArray, ...]]:
    """Distance in mm of every pixel from a mask, and the nearest pixel of it."""
    away, nearest = ndimage.distance_transform_edt(~mask, sampling=spacing, return_indices=True)
    return away, tuple(nearest)


def _heights(
    endings: IntArray,
    count: int,
    before: SingleArray | None,
    depth: FloatArray,
    step: float,
) -> FloatArray:
    """How far (count + 1,) what ends goes on in mm, by how the square of its depth has fallen."""
    # Where no slice before tells, ends are round; nowhere are they needles.
    if before is None:
        return np.clip(ROUND * depth, LOWEST * step, HIGHEST * step)
    highest = np.clip(SLENDER * depth, LOWEST * step, HIGHEST * step)
    deeper = -np.asarray(ndimage.minimum(before, endings, np.arange(count + 1)), np.float64)
    fall = np.maximum(deeper, 0) ** 2 - depth**2
    height = np.divide(depth**2 * step, fall, out=highest.copy(), where=fall > 0)
    return np.clip(height, LOWEST * step, highest)


def round_ends(
    fields: Sequence[LevelField],
    drawn: SingleArray,
    spacing: FloatArray,
    step: float,
    cut: tuple[bool, bool],
    pixel: float,
    guides: Sequence[GuideLine] = (),
) -> list[LevelField]:
    """Round the ends of parts, and of cavities, between the slices and beyond the first and the last.

    Parameters
    ----------
    fields : sequence of LevelField
        Of slices, and interpolated between them, ascending.
    drawn : (S, I, J) float32
        The distances of the slices before anything was filled in: those may reach less far.
    spacing : (2,) float64
        mm per pixel.
    step : float
        Distance between slices in mm.
    cut : (bool, bool)
        Whether the scan cuts the organ at the first and at the last slice: there it does not end.
    pixel : float
        mm; levels that are added beyond the ends lie about as far apart.
    guides : sequence of GuideLine, optional
        Planes across the slices, which show how far parts go on beyond the first and the last slice.

    Returns
    -------
    list of LevelField
        Those of slices are as they were; with more levels below and above where it is not cut.
    """
    slices = [n for n, level in enumerate(fields) if level.source_slice is not None]
    planes = [level.distance for level in fields]
    beyond: dict[int, list[LevelField]] = {-1: [], 1: []}
    for way, of_parts in itertools.product((1, -1), (True, False)):
        sign = np.float32(1 if of_parts else -1)  # a cavity ends as a part does, inside out
        order = slices[::way]
        for k, n in enumerate(order):
            last = k + 1 == len(order)
            if last and (cut[way > 0] or not of_parts):
                continue
            own = sign * drawn[::way][k]
            before = sign * drawn[::way][k - 1] if k else None
            gap = range(0) if last else range(n + way, order[k + 1] + way, way)
            between = [sign * fields[m].distance for m in gap]
            rise = partial(_rise, guides, fields[n].z, way) if last and guides else None
            ends = _Ends.of(sign * fields[n].distance, own, before, between, spacing, step, rise)
            if ends is None:
                continue
            if last:
                beyond[way] = _levels_beyond(fields[n].z, way, ends, step, pixel)
                continue
            for m in range(n + way, order[k + 1], way):
                planes[m] = sign * ends.on(sign * planes[m], abs(fields[m].z - fields[n].z))
    inner = [replace(level, distance=plane) for level, plane in zip(fields, planes, strict=True)]
    return [*beyond[-1][::-1], *inner, *beyond[1]]


def _rise(guides: Sequence[GuideLine], z: float, way: int, part: BoolArray) -> float | None:
    """How far in mm a part (I, J) goes on by what planes across show, if one meets it."""
    seen = [guide.rise(part, z, way) for guide in guides]
    return max((rise for rise in seen if rise is not None), default=None)


def _levels_beyond(z: float, way: int, ends: _Ends, step: float, pixel: float) -> list[LevelField]:
    """Levels beyond the last slice, until everything has ended."""
    reach = BEYOND * max(HIGHEST * step, float(ends.height.max()))
    rises = np.linspace(0, reach, max(3, int(np.ceil(reach / pixel))) + 1)[1:]
    return [LevelField(z + way * float(rise), ends.on(ends.own, float(rise)), None) for rise in rises]
