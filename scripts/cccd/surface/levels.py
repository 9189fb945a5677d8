"""Distances in space on the slices and on levels between them, below the pixel: by the learned network."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from cccd.geometry.arrays import BoolArray, FloatArray, SingleArray
from cccd.geometry.distance import to_mask
from cccd.surface.learned_distance import (
    LEAST_RATIO,
    MOST_RATIO,
    RANGE,
    REACH,
    SLICES,
    Surroundings,
    in_space,
    near_surface,
    shipped_network,
)

__all__ = ["levels_of_slices"]

#: Between slices further apart than it has seen it is asked on every n-th pixel; its share falls from all to
#: none between these ratios of slice distance to pixel.
ASKED_RATIOS = (7.0, 14.0)
#: Where the network sees a pixel of a slice on the other side, it lies so far on its own, in pixels.
LEAST = 0.05
#: Voxels are cubes where no edge is this many times as long as another: their other two stacks of slices tell
#: as much as the first. They are asked on so many pixels beside the surface.
CUBES, ASKED_AGAIN = 1.1, 1.0
#: The network's share falls to nothing over this share of the distances at which it is asked.
FADING = 0.3


@dataclass(frozen=True)
class _Level:
    """A level: a number of slice, and how far above it, in the distance to the next, it lies."""

    nearest: int
    height: float
    z: float
    ratio: float


def levels_of_slices(
    planes: SingleArray, z: FloatArray, step: float, spacing: FloatArray, cut: tuple[bool, bool], exact: bool
) -> tuple[FloatArray, SingleArray]:
    """Estimate the distances on slices, and on levels about a pixel apart between them.

    Parameters
    ----------
    planes : (S, I, J) float32
        Distances within slices in mm, negative inside.
    z : (S,) float64
        Their heights in mm, ascending.
    step : float
        How far beyond the first and the last one the next slices would lie, in mm.
    spacing : (2,) float64
        Edge lengths of a pixel in mm.
    cut : (bool, bool)
        Whether the scan ends at the first and at the last slice: what these and the ones beside them show
        goes on beyond. Elsewhere the next slice is empty, and is a level, too.
    exact : bool
        Whether distances are known below the pixel.

    Returns
    -------
    z : (L,) float64
        Heights in mm, ascending.
    values : (L, I, J) float32
        Distances in mm; where they are far from the surface, to first order.
    """
    pixel = float(np.sqrt(spacing.prod()))
    near = planes / np.float32(pixel)
    below, above = (
        _beyond(near, side, goes_on, spacing / pixel) for side, goes_on in zip((0, -1), cut, strict=True)
    )
    stack = np.concatenate([below, near, above])
    beyond = step * np.arange(1, SLICES + 1)
    heights = np.concatenate([z[0] - beyond[::-1], z, z[-1] + beyond])
    first, last = SLICES - (not cut[0]), SLICES + len(z) - 1 + (not cut[1])
    levels = list(_levels(heights / pixel, first, last))
    values = np.stack([_estimated(stack, level, exact) for level in levels])
    on_slices = np.flatnonzero([level.height == 0 for level in levels])
    if not exact and len(levels) == len(on_slices):
        inside = stack[first : last + 1] < 0
        values = _of_cubes(values, inside, np.array([step, *spacing]) / pixel, cut)
    for low, high in itertools.pairwise(on_slices):
        _change_sign_once(values[low : high + 1])
    return np.array([level.z for level in levels]) * pixel, values * np.float32(pixel)


def _of_cubes(
    values: SingleArray, inside: BoolArray, edges: FloatArray, cut: tuple[bool, bool]
) -> SingleArray:
    """Average the distances (S, I, J) of voxels that are cubes over the three stacks of slices through them.

    Edges (3,) and distances, which are those of one stack, are in pixels; ``cut`` is of `levels_of_slices`.
    """
    if edges.max() > CUBES * edges.min():
        return values
    beyond = [
        np.repeat(inside[[end]] & goes_on, REACH, axis=0) for end, goes_on in zip((0, -1), cut, strict=True)
    ]
    own, longer = slice(REACH, REACH + len(inside)), np.concatenate([beyond[0], inside, beyond[1]])
    total, count = values.copy(), np.ones(values.shape, np.float32)
    for axis in (1, 2):
        planes, known = np.moveaxis(longer, axis, 0), np.moveaxis(values, axis, 0)
        asked = np.abs(known) < ASKED_AGAIN
        summed, counted = np.moveaxis(total, axis, 0), np.moveaxis(count, axis, 0)
        stack = np.full((len(planes) + 2 * SLICES, *planes.shape[1:]), RANGE, np.float32)
        for number in np.flatnonzero(planes.any(axis=(1, 2))):
            stack[number + SLICES] = np.minimum(to_mask(planes[number], np.delete(edges, axis)), RANGE)
        for number in np.flatnonzero(asked.any(axis=(1, 2))):
            near = np.maximum(stack[number : number + 2 * SLICES + 1], -RANGE)
            base = in_space(near[SLICES - 1], near[SLICES], near[SLICES + 1], 1.0, 0.0)
            base[own][~asked[number]] = RANGE
            again = (base + _correction(near, base, 1.0, 0.0, False))[own]
            summed[number] += np.where(asked[number], again, 0)
            counted[number] += asked[number]
    mean = total / count
    wrong = (mean < 0) != inside
    mean[wrong] = np.copysign(np.float32(LEAST), values[wrong])
    return mean


def _beyond(planes: SingleArray, side: int, goes_on: bool, spacing: FloatArray) -> SingleArray:
    """Give what `SLICES` slices beyond the first (0) or last (-1) one show, in pixels."""
    if not goes_on:
        return np.full((SLICES, *planes.shape[1:]), RANGE, np.float32)
    end = planes[side]
    if len(planes) > 1:  # what the slice before does not show begins at the scan's end: it ends there, too
        parts, count = ndimage.label(end < 0)
        known = np.zeros(count + 1, np.bool_)
        known[np.unique(parts[planes[1 if side == 0 else -2] < 0])] = True
        stays: BoolArray = known[parts] & (parts > 0)
        if stays.any() and not known[1:].all():
            end = to_mask(stays, spacing)
    return np.repeat(end[None], SLICES, axis=0)


def _levels(heights: FloatArray, first: int, last: int) -> Iterator[_Level]:
    """Levels from one slice of a stack to another, from low to high; heights are in pixels."""
    for k in range(first, last + 1):
        gap = float(heights[k + 1] - heights[k])
        yield _Level(k, 0.0, float(heights[k]), min(gap, float(heights[k] - heights[k - 1])))
        parts = max(1, round(gap)) if k < last else 1
        for part in range(1, parts):
            share = part / parts
            nearest, height = (k, share) if share <= 0.5 else (k + 1, share - 1)
            yield _Level(nearest, height, float(heights[k]) + share * gap, gap)


def _change_sign_once(values: SingleArray) -> None:
    """Let distances (L, I, J) from slice to slice grow, or fall, where one shows the organ and one does not.

    Each level is estimated by itself: in the middle of a flat end the network knows no better than that it
    lies between two slices, and levels that contradict each other would be thin cavities.
    """
    here = np.nonzero((values[0] < 0) != (values[-1] < 0))
    column = values[:, *here]
    way = np.where(column[-1] < 0, np.float32(-1), np.float32(1))
    growing = column * way
    least = np.minimum.accumulate(growing[::-1], axis=0)[::-1]
    values[:, *here] = way * (np.maximum.accumulate(growing, axis=0) + least) / 2


def _estimated(stack: SingleArray, level: _Level, exact: bool) -> SingleArray:
    """Distances (I, J) on a level, in pixels."""
    k, ratio, height = level.nearest, level.ratio, level.height
    own = stack[max(k - SLICES, 0) : k + SLICES + 1]
    missing = max(SLICES - k, 0), max(k + SLICES + 1 - len(stack), 0)
    own = np.pad(own, (missing, (0, 0), (0, 0)), mode="edge")
    estimated = _below_pixels(own, ratio, height, exact)
    if height == 0:  # what a slice shows stays on its side
        wrong = (estimated < 0) != (stack[k] < 0)
        estimated[wrong] = np.copysign(np.float32(LEAST), stack[k][wrong])
    return estimated


def _below_pixels(own: SingleArray, ratio: float, height: float, exact: bool) -> SingleArray:
    """Distances (I, J) above the middle one of some slices, in pixels; see `in_space`."""
    share = np.float32(np.interp(ratio, ASKED_RATIOS, (1, 0)))
    coarser = int(np.ceil(ratio / MOST_RATIO))
    if share == 0:
        return _cubic(own, ratio, height)
    seen = np.clip(own, -RANGE, RANGE)
    base = in_space(seen[SLICES - 1], seen[SLICES], seen[SLICES + 1], ratio, height)
    if coarser == 1:
        return base + _correction(seen, base, max(ratio, LEAST_RATIO), height, exact)
    # slices lie so far apart that what changes between them is seen on coarser pixels, which are well known
    few = np.clip(own[:, ::coarser, ::coarser] / np.float32(coarser), -RANGE, RANGE)
    coarse = in_space(few[SLICES - 1], few[SLICES], few[SLICES + 1], ratio / coarser, height)
    correction = _correction(few, coarse, ratio / coarser, height, True)
    places: FloatArray = np.indices(base.shape).astype(float) / coarser
    moved = ndimage.map_coordinates(correction, places, np.float32, order=1, mode="nearest")
    asked = base + np.float32(coarser) * moved
    mixed = asked if share == 1 else share * asked + (1 - share) * _cubic(own, ratio, height)
    return np.asarray(mixed, np.float32)


def _cubic(own: SingleArray, ratio: float, height: float) -> SingleArray:
    """Distances (I, J) in space by a cubic between slices that are taken as even, monotone in each gap."""
    # Fritsch and Carlson 1980; a straight line (Raya and Udupa 1990) has a kink at the slices
    if height == 0:
        return in_space(own[SLICES - 1], own[SLICES], own[SLICES + 1], ratio, height)
    low = SLICES if height > 0 else SLICES - 1
    share = np.float32(height if height > 0 else 1 + height)
    before, rise, after = np.diff(own[low - 1 : low + 3], axis=0)
    slopes: list[SingleArray] = []
    for one, other in ((before, rise), (rise, after)):
        same = one * other > 0
        total = np.where(same, one + other, np.float32(1))
        slopes.append(np.where(same, 2 * one * other / total, np.float32(0)))
    s, t = share, 1 - share
    plane = (1 + 2 * s) * t * t * own[low] + s * s * (3 - 2 * s) * own[low + 1]
    plane = plane + s * t * (t * slopes[0] - s * slopes[1])
    return np.asarray(plane / np.sqrt(1 + (rise / np.float32(ratio)) ** 2), np.float32)


def _correction(own: SingleArray, base: SingleArray, ratio: float, height: float, exact: bool) -> SingleArray:
    """By how much (I, J) the network changes the distances on a level, seen with slices around it."""
    out, most = np.zeros_like(base), near_surface(ratio)
    asked = np.argwhere(np.abs(base) < most)
    if len(asked) == 0:
        return out
    padded = np.pad(own, ((0, 0), (REACH, REACH), (REACH, REACH)), mode="edge")
    known = base[tuple(asked.T)]
    nodes = np.column_stack([np.zeros(len(asked), np.int64), asked])
    around = Surroundings.of(padded, nodes, known)
    share = np.clip((most - np.abs(known)) / np.float32(FADING * most), 0, 1)
    out[tuple(asked.T)] = share * (shipped_network().estimate(around, ratio, height, exact) - known)
    return out
