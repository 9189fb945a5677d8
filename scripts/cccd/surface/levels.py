"""Distances in space on the slices and on levels between them, below the pixel: by the learned network."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from cccd.geometry.arrays import BoolArray, FloatArray, IntArray, SingleArray
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

#: Between slices further apart than it has seen it is asked on every n-th pixel; its share falls from all to
#: none between these ratios of slice distance to pixel. Up to 14, all of ten exact truths are 1 to 11 %
#: farther off; up to 18, small handles appear.
ASKED_RATIOS = (7.0, 16.0)
#: Where the network sees a pixel of a slice on the other side, this share of the slice's own distance holds:
#: holes of one pixel stay holes; to exact truth it is as near as with a tenth of that.
OWN = 0.4
#: Voxels are cubes where no edge is this many times as long as another: their other two stacks of slices tell
#: as much as the first.
CUBES = 1.1
#: Places that are estimated at once: what they see stays in the processor's cache.
BLOCK = 2048


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
    values = _estimated(stack, levels, exact)
    on_slices = np.flatnonzero([level.height == 0 for level in levels])
    if not exact and len(levels) == len(on_slices):
        inside = stack[first : last + 1] < 0
        values = _of_cubes(values, inside, np.array([step, *spacing]) / pixel, cut)
    for low, high in itertools.pairwise(on_slices):
        if high > low + 1:
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
    asked = np.zeros(longer.shape, np.bool_)
    asked[own] = _beside_surface(values)
    total, count = values.copy(), 1 + 2 * asked[own].astype(np.float32)
    for axis in (1, 2):
        planes = np.moveaxis(longer, axis, 0)
        stack = np.full((len(planes) + 2 * SLICES, *planes.shape[1:]), RANGE, np.float32)
        for number in np.flatnonzero(planes.any(axis=(1, 2))):
            stack[number + SLICES] = to_mask(planes[number], np.delete(edges, axis))
        nodes = np.argwhere(np.moveaxis(asked, axis, 0))
        again = _asked(_padded(stack), nodes + np.array([SLICES, 0, 0]), 1.0, 0.0, False)
        back = np.insert(nodes[:, 1:], axis, nodes[:, 0], axis=1) - [REACH, 0, 0]
        total[tuple(back.T)] += again
    mean = total / count
    return _on_its_side(mean, values)


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


def _estimated(stack: SingleArray, levels: Sequence[_Level], exact: bool) -> SingleArray:
    """Distances (L, I, J) on levels, in pixels: by the network beside the surface, wherever it moves that."""
    values = np.stack([_plain(stack, level) for level in levels])
    most = np.array([near_surface(level.ratio) if level.ratio <= MOST_RATIO else 0.0 for level in levels])
    open_: BoolArray = np.abs(values) < most[:, None, None]
    conditions: dict[tuple[float, float], list[int]] = {}
    for number, level in enumerate(levels):  # levels whose ratios differ by rounding are asked at once
        ratio = round(max(level.ratio, LEAST_RATIO), 6)
        conditions.setdefault((ratio, level.height), []).append(number)
    padded = _padded(stack)
    while (asked := open_ & _beside_surface(values)).any():
        for (ratio, height), numbers in conditions.items():
            which, *places = np.nonzero(asked[numbers])
            slices = np.array([levels[number].nearest for number in numbers])[which]
            found = _asked(padded, np.column_stack([slices, *places]), ratio, height, exact)
            if height == 0:
                found = _on_its_side(found, stack[slices, *places])
            values[np.array(numbers)[which], *places] = found
        open_ &= ~asked
    return values


def _on_its_side(values: SingleArray, shown: SingleArray) -> SingleArray:
    """Distances of which each stays on the side that its slice shows."""
    return np.where((values < 0) == (shown < 0), values, np.float32(OWN) * shown)


def _beside_surface(values: FloatArray | SingleArray) -> BoolArray:
    """Which nodes (L, I, J) lie on another side of the surface than one beside them."""
    inside, beside = values < 0, np.zeros(values.shape, np.bool_)
    for axis in range(3):
        changes = np.diff(inside, axis=axis)
        np.moveaxis(beside, axis, 0)[1:] |= np.moveaxis(changes, axis, 0)
        np.moveaxis(beside, axis, 0)[:-1] |= np.moveaxis(changes, axis, 0)
    return beside


def _padded(stack: SingleArray) -> SingleArray:
    """Slices as far as the network looks around them."""
    around = (SLICES, SLICES), (REACH, REACH), (REACH, REACH)
    return np.pad(np.clip(stack, -RANGE, RANGE), around, mode="edge")


def _asked(padded: SingleArray, nodes: IntArray, ratio: float, height: float, exact: bool) -> SingleArray:
    """Distances (N,) by the network above nodes (N, 3) of `_padded` slices and pixels; see `in_space`."""
    k, i, j = (nodes + np.array([SLICES, REACH, REACH])).T
    below, own, above = (padded[k + step, i, j] for step in (-1, 0, 1))
    base = in_space(below, own, above, ratio, height)
    found = np.empty_like(base)
    for start in range(0, len(nodes), BLOCK):
        here = slice(start, start + BLOCK)
        around = Surroundings.of(padded, nodes[here], base[here])
        found[here] = shipped_network().estimate(around, ratio, height, exact)
    return found


def _plain(stack: SingleArray, level: _Level) -> SingleArray:
    """Distances (I, J) on a level, in pixels, without the network, or with it on coarser pixels."""
    k, ratio, height = level.nearest, level.ratio, level.height
    own = stack[np.clip(np.arange(k - SLICES, k + SLICES + 1), 0, len(stack) - 1)]
    share = np.float32(np.interp(ratio, ASKED_RATIOS, (1, 0)))
    if share == 0:
        return _cubic(own, ratio, height)
    seen = np.clip(own, -RANGE, RANGE)
    base = in_space(seen[SLICES - 1], seen[SLICES], seen[SLICES + 1], ratio, height)
    if ratio <= MOST_RATIO:
        return base
    # slices lie so far apart that what changes between them is seen on coarser pixels, which are well known
    coarser = int(np.ceil(ratio / MOST_RATIO))
    few = own[:, ::coarser, ::coarser] / np.float32(coarser)
    seen = np.clip(few, -RANGE, RANGE)
    coarse = in_space(seen[SLICES - 1], seen[SLICES], seen[SLICES + 1], ratio / coarser, height)
    correction, near = np.zeros_like(coarse), np.abs(coarse) < near_surface(ratio / coarser)
    nodes = np.insert(np.argwhere(near), 0, SLICES, axis=1)
    correction[near] = _asked(_padded(few), nodes, ratio / coarser, height, True) - coarse[near]
    places: FloatArray = np.indices(base.shape).astype(float) / coarser
    moved = ndimage.map_coordinates(correction, places, np.float32, order=1, mode="nearest")
    asked = base + np.float32(coarser) * moved
    mixed = asked if share == 1 else share * asked + (1 - share) * _cubic(own, ratio, height)
    mixed = np.asarray(mixed, np.float32)
    return _on_its_side(mixed, stack[k]) if height == 0 else mixed


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
