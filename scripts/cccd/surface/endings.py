"""Parts that end between two slices: a rounded end in the distances, where none of it lies on the next slice.

Interpolated distances close such a part at once, on a level that depends on how far away its neighbours are.
Near its pole the section of any smooth body falls linearly with height, as a paraboloid's does; so how fast
the areas of the last two slices fall says how far the part goes.
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
#: Levels beyond the last slice reach this many times as far as the highest end.
BEYOND = 1.5


@dataclass(frozen=True, eq=False)
class _Ends:
    """What ends on one slice, towards the next.

    Attributes
    ----------
    own : (I, J) float32
        Signed distance in mm to the parts that end.
    here : (I, J) bool
        Pixels that are nearer to one of them than to anything that goes on.
    depth, height : (I, J) float32
        Of the nearest of them: its largest distance inside, and how far it goes on, both in mm.
    """

    own: SingleArray
    here: BoolArray
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
        """Find the parts of a plane of which none lies on the next; None without any."""
        parts, count = _parts(plane)
        goes_on = np.zeros(count + 1, np.bool_)
        goes_on[0] = True
        if after is not None:
            goes_on[np.unique(parts[after < 0])] = True
        goes_on[np.unique(np.concatenate([parts[[0, -1]].ravel(), parts[:, [0, -1]].ravel()]))] = True
        if goes_on.all():
            return None
        ended = ~goes_on[parts]
        away, nearest = _away(ended, spacing)
        own = np.where(ended, plane, np.maximum(away, np.abs(plane))).astype(np.float32)
        other = np.full(plane.shape, np.inf)
        stays = (parts > 0) & ~ended if after is None else ((parts > 0) & ~ended) | (after < 0)
        if stays.any():
            other = ndimage.distance_transform_edt(~stays, sampling=spacing)
        number = parts[nearest]
        depth = -np.asarray(ndimage.minimum(plane, parts, np.arange(count + 1)))
        height = _heights(parts, count, before, nearest, step)
        here = np.asarray(own < other, np.bool_)
        return cls(own, here, depth[number].astype(np.float32), height[number].astype(np.float32))

    def at(self, rise: float) -> SingleArray:
        """Signed distances (I, J) in mm on a level ``rise`` mm beyond the slice."""
        share = rise / self.height
        fall = np.where(share < 1, 1 - np.sqrt(np.maximum(1 - share, 0)), 1 + 2 * (share - 1))
        return np.asarray(self.own + self.depth * fall, np.float32)


def _parts(plane: SingleArray) -> tuple[IntArray, int]:
    parts = np.zeros(plane.shape, np.int64)
    count = ndimage.label(plane < 0, output=parts)
    return parts, int(cast(Any, count))


def _away(mask: BoolArray, spacing: FloatArray) -> tuple[FloatArray, tuple[IntArray, ...]]:
    """Distance in mm of every pixel from a mask, and the nearest pixel of it."""
    away, nearest = ndimage.distance_transform_edt(~mask, sampling=spacing, return_indices=True)
    return away, tuple(nearest)


def _heights(
    parts: IntArray,
    count: int,
    before: SingleArray | None,
    nearest: tuple[IntArray, ...],
    step: float,
) -> FloatArray:
    """How far (count + 1,) the parts of a slice go on in mm, by how their areas have fallen."""
    area = np.bincount(parts.ravel(), minlength=count + 1).astype(float)
    highest = np.full(count + 1, HIGHEST * step)
    if before is None:
        return highest
    fall = np.bincount(parts[nearest][before < 0], minlength=count + 1) - area
    height = np.divide(area * step, fall, out=highest.copy(), where=fall > 0)
    return np.clip(height, LOWEST * step, HIGHEST * step)


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
                value = sign * ends.at(abs(fields[m].z - fields[n].z))
                planes[m] = np.where(ends.here, value, planes[m]).astype(np.float32)
    inner = [replace(level, distance=plane) for level, plane in zip(fields, planes, strict=True)]
    return [*beyond[-1][::-1], *inner, *beyond[1]]


def _levels_beyond(z: float, way: int, ends: _Ends, step: float, pixel: float) -> list[LevelField]:
    """Levels beyond the last slice, until everything has ended."""
    reach = BEYOND * HIGHEST * step
    rises = np.linspace(0, reach, max(3, int(np.ceil(reach / pixel))) + 1)[1:]
    return [LevelField(z + way * float(rise), ends.at(float(rise)), None) for rise in rises]
