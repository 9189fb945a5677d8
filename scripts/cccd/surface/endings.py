"""Parts and lobes that end between two slices: a rounded end in the distances.

Interpolated distances close such a part at once, on a level that depends on how far away its neighbours are.
Near its pole the section of any smooth body falls linearly with height, as a paraboloid's does; so how fast
the square of its width falls from slice to slice says how far the part goes. A lobe ends in the same way
where its part goes on elsewhere: it is deep, and all of the next slice is far from it.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np
from scipy import ndimage

from cccd.geometry.arrays import BoolArray, FloatArray, IntArray, SingleArray
from cccd.surface.fields import LevelField

__all__ = ["round_ends"]

#: A part goes on beyond its last slice by these shares of the distance between slices, at least and at most:
#: at the next slice there is none of it.
LOWEST, HIGHEST = 0.2, 0.9
#: An end is at most so many times as high as the part is deep: its largest distance inside. The first holds
#: where only one slice shows the part, so that nothing says how it tapers.
ROUND, SLENDER = 1.5, 4.0
#: A lobe is so many pixels deep, and so many times as far from the next slice.
LOBE_PIXELS, LOBE_FAR = 2.0, 2.0
#: Levels beyond the last slice reach this many times as far as the highest end.
BEYOND = 1.5


@dataclass(frozen=True, eq=False)
class _Ends:
    """What ends on one slice, towards the next: parts of which none lies there, and lobes of others.

    Attributes
    ----------
    own : (I, J) float32
        Signed distance in mm to what ends.
    share : (I, J) float32
        1 where a part ends, less towards where a lobe joins what goes on, 0 elsewhere.
    lobe : (I, J) bool
        Pixels nearest to a lobe: what is interpolated there may reach further than its end.
    depth, height : (I, J) float32
        Of the nearest of them: its largest distance inside, and how far it goes on, both in mm.
    """

    own: SingleArray
    share: SingleArray
    lobe: BoolArray
    depth: SingleArray
    height: SingleArray

    @classmethod
    def of(
        cls,
        plane: SingleArray,
        before: SingleArray | None,
        after: SingleArray | None,
        spacing: FloatArray,
        step: float,
    ) -> _Ends | None:
        """Find the parts of a plane of which none lies on the next, and lobes; None without any."""
        parts, count = _parts(plane < 0)
        goes_on = np.zeros(count + 1, np.bool_)
        goes_on[0] = True
        if after is not None:
            goes_on[np.unique(parts[after < 0])] = True
        goes_on[np.unique(np.concatenate([parts[[0, -1]].ravel(), parts[:, [0, -1]].ravel()]))] = True
        ended = ~goes_on[parts]
        lobes = np.zeros_like(ended) if after is None else _lobes(plane, after, ended, spacing)
        if not ended.any() and not lobes.any():
            return None
        away, nearest = _away(ended | lobes, spacing)
        own = np.where(ended | lobes, plane, np.maximum(away, np.abs(plane))).astype(np.float32)
        stays = (parts > 0) & ~ended & ~lobes
        if after is not None:
            stays |= after < 0
        other = ndimage.distance_transform_edt(~stays, sampling=spacing) if stays.any() else np.inf
        share = np.ones(plane.shape)
        if after is not None:
            share = np.where(lobes, np.clip(after / np.maximum(-plane, 1e-6) - 1, 0, 1), share)
        share = np.where(own < other, share[nearest], 0)
        endings, number = _parts(ended | lobes)
        depth = -np.asarray(ndimage.minimum(plane, endings, np.arange(number + 1)), np.float64)
        height = _heights(endings, number, before, depth, step)
        which = endings[nearest]
        return cls(
            own,
            share.astype(np.float32),
            lobes[nearest],
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
        end = np.where(self.lobe, np.minimum(end, level), end)
        return np.where(self.share > 0, level + self.share * (end - level), level).astype(np.float32)


def _lobes(plane: SingleArray, after: SingleArray, ended: BoolArray, spacing: FloatArray) -> BoolArray:
    """Pixels (I, J) of lobes that end though their part goes on: deep, and far from all of the next slice."""
    parts, count = _parts((plane < 0) & (after > -plane) & ~ended)
    if count == 0:
        return np.zeros(plane.shape, np.bool_)
    deepest = np.array(ndimage.minimum_position(plane, parts, np.arange(1, count + 1)))
    depth, far = -plane[tuple(deepest.T)], after[tuple(deepest.T)]
    is_lobe = np.zeros(count + 1, np.bool_)
    is_lobe[1:] = (depth >= LOBE_PIXELS * np.sqrt(spacing.prod())) & (far >= LOBE_FAR * depth)
    return is_lobe[parts]


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
    """How far (count + 1,) what ends goes on in mm, by how the square of its depth has fallen.

    Where no slice before tells, ends are round; nowhere are they needles.
    """
    if before is None:
        return np.clip(ROUND * depth, LOWEST * step, HIGHEST * step)
    highest = np.clip(SLENDER * depth, LOWEST * step, HIGHEST * step)
    deeper = -np.asarray(ndimage.minimum(before, endings, np.arange(count + 1)), np.float64)
    fall = np.maximum(deeper, 0) ** 2 - depth**2
    height = np.divide(depth**2 * step, fall, out=highest.copy(), where=fall > 0)
    return np.clip(height, LOWEST * step, highest)


def round_ends(
    fields: Sequence[LevelField], spacing: FloatArray, step: float, cut: tuple[bool, bool], pixel: float
) -> list[LevelField]:
    """Round the ends of parts, and of cavities, between the slices and beyond the first and the last.

    Parameters
    ----------
    fields : sequence of LevelField
        Of slices, and interpolated between them, ascending.
    spacing : (2,) float64
        mm per pixel.
    step : float
        Distance between slices in mm.
    cut : (bool, bool)
        Whether the scan cuts the organ at the first and at the last slice: there it does not end.
    pixel : float
        mm; levels that are added beyond the ends lie about as far apart.

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
            before, after = (
                sign * fields[order[m]].distance if 0 <= m < len(order) else None for m in (k - 1, k + 1)
            )
            if after is None and (cut[way > 0] or not of_parts):
                continue
            ends = _Ends.of(sign * fields[n].distance, before, after, spacing, step)
            if ends is None:
                continue
            if after is None:
                beyond[way] = _levels_beyond(fields[n].z, way, ends, step, pixel)
                continue
            for m in range(n + way, order[k + 1], way):
                planes[m] = sign * ends.on(sign * planes[m], abs(fields[m].z - fields[n].z))
    inner = [replace(level, distance=plane) for level, plane in zip(fields, planes, strict=True)]
    return [*beyond[-1][::-1], *inner, *beyond[1]]


def _levels_beyond(z: float, way: int, ends: _Ends, step: float, pixel: float) -> list[LevelField]:
    """Levels beyond the last slice, until everything has ended."""
    reach = BEYOND * HIGHEST * step
    rises = np.linspace(0, reach, max(3, int(np.ceil(reach / pixel))) + 1)[1:]
    return [LevelField(z + way * float(rise), ends.on(ends.own, float(rise)), None) for rise in rises]
