"""Damage of boundary maps that no training of a junction network uses: what its doubts are measured on.

Published augmentations (Cutout, DeVries and Taylor 2017; GridMask, Chen et al. 2020), what imaging does (a
noisy slice's threshold, ghosts of motion, coarse pixels, streaks of metal, calcifications), and what is drawn
or stored with an outline (hatching, letters, lost pixels). `cccd_datasets.corruptions` has the kinds that
training draws. Every function takes a generator, a mask (I, J) and its outline (I, J) bool, and returns a
map.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import cv2
import numpy as np
from scipy import ndimage

from cccd.geometry.arrays import AnyArray, BoolArray
from cccd.geometry.opencv import distance_to_zero

_Damage = Callable[[np.random.Generator, AnyArray, BoolArray], BoolArray]


def thresholded(rng: np.random.Generator, mask: AnyArray, outline: BoolArray) -> BoolArray:
    """Outline everything above the level of a noisy slice: ragged, with islands and pinholes."""
    distance = ndimage.distance_transform_edt(mask) - ndimage.distance_transform_edt(~mask)
    noise = ndimage.gaussian_filter(rng.normal(size=mask.shape), 1.2)
    found = distance + 2.5 * noise / noise.std() > 0
    return found & ~ndimage.binary_erosion(found)


def ghost(rng: np.random.Generator, mask: AnyArray, outline: BoolArray) -> BoolArray:
    """Draw parts of the outline a second time, as if the slice had moved meanwhile."""
    moved = ndimage.shift(outline, rng.integers(3, 8, 2) * rng.choice([-1, 1], 2), order=0)
    kept = ndimage.gaussian_filter(rng.normal(size=mask.shape), 15) > 0
    return outline | (moved & kept)


def cutout(rng: np.random.Generator, mask: AnyArray, outline: BoolArray) -> BoolArray:
    """Cut out squares, and draw the frames of some."""
    observed = outline.copy()
    for place in rng.permutation(np.argwhere(outline))[:6]:
        half = int(rng.integers(3, 7))
        (top, left), (bottom, right) = place - half, place + half
        observed[top : bottom + 1, left : right + 1] = False
        if rng.random() < 0.5:
            observed[[top, bottom], left : right + 1] = True
            observed[top : bottom + 1, [left, right]] = True
    return observed


def grid_mask(rng: np.random.Generator, mask: AnyArray, outline: BoolArray) -> BoolArray:
    """Erase a regular grid of squares."""
    period, width = int(rng.integers(14, 24)), int(rng.integers(4, 7))
    row, column = np.indices(mask.shape) + rng.integers(0, period, 2)[:, None, None]
    return outline & ~((row % period < width) & (column % period < width))


def coarse(rng: np.random.Generator, mask: AnyArray, outline: BoolArray) -> BoolArray:
    """Store the map at half its size: blocks of two pixels, some lost."""
    rows, columns = (size // 2 * 2 for size in outline.shape)
    blocks = outline[:rows, :columns].reshape(rows // 2, 2, columns // 2, 2).any(axis=(1, 3))
    blocks &= rng.random(blocks.shape) > 0.05
    observed = np.zeros_like(outline)
    observed[:rows, :columns] = np.kron(blocks, np.ones((2, 2), bool))
    return observed


def hatched(rng: np.random.Generator, mask: AnyArray, outline: BoolArray) -> BoolArray:
    """Draw parallel straight lines across the whole slice."""
    lines = np.zeros(mask.shape, np.uint8)
    angle, gap = rng.uniform(0, np.pi), rng.uniform(25, 40)
    normal, along = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
    centre, reach = np.array(mask.shape[::-1]) / 2, sum(mask.shape)
    for offset in np.arange(-reach, reach, gap):
        _line(lines, [centre + offset * normal + side * reach * along for side in (-1, 1)])
    return outline | (lines > 0)


def dashed(rng: np.random.Generator, mask: AnyArray, outline: BoolArray) -> BoolArray:
    """Lose a quarter to a half of the outline, in regular stretches."""
    row, column = np.nonzero(outline)
    centre = np.argwhere(mask).mean(axis=0)
    period = 2 * np.pi / rng.integers(8, 25)
    turn = np.arctan2(row - centre[0], column - centre[1]) % period
    observed = outline.copy()
    observed[row, column] = turn > rng.uniform(0.25, 0.5) * period
    return observed


def sparse(rng: np.random.Generator, mask: AnyArray, outline: BoolArray) -> BoolArray:
    """Lose single pixels, up to half of them."""
    return outline & (rng.random(outline.shape) > rng.uniform(0.15, 0.5))


def vessels(rng: np.random.Generator, mask: AnyArray, outline: BoolArray) -> BoolArray:
    """Draw lines that wander off the outline, inwards and outwards."""
    lines = np.zeros(mask.shape, np.uint8)
    for start in rng.permutation(np.argwhere(outline))[: rng.integers(3, 9)]:
        steps = rng.integers(15, 50)
        heading = rng.uniform(0, 2 * np.pi) + np.cumsum(rng.normal(0, 0.25, steps))
        way = start[::-1] + np.cumsum(np.column_stack([np.cos(heading), np.sin(heading)]), axis=0)
        _line(lines, way)
    return outline | (lines > 0)


def streaks(rng: np.random.Generator, mask: AnyArray, outline: BoolArray) -> BoolArray:
    """Draw rays of metal inside the organ."""
    lines = np.zeros(mask.shape, np.uint8)
    inside = np.argwhere(mask)
    metal, reach = inside[rng.integers(len(inside))][::-1], sum(mask.shape)
    for angle in rng.uniform(0, 2 * np.pi, rng.integers(3, 9)):
        begin, end = rng.uniform(0, 8), rng.uniform(0.1, 0.4) * reach
        _line(lines, [metal + far * np.array([np.cos(angle), np.sin(angle)]) for far in (begin, end)])
    return outline | (lines > 0)


def tiled(rng: np.random.Generator, mask: AnyArray, outline: BoolArray) -> BoolArray:
    """Draw borders of a tiling, as of superpixels, in places."""
    seeds = rng.uniform(0, 1, (int(rng.integers(15, 40)), 2)) * mask.shape
    grid = np.indices(mask.shape).reshape(2, -1).T
    nearest = ((grid[:, None] - seeds) ** 2).sum(axis=2).argmin(axis=1).reshape(mask.shape)
    borders = np.zeros(mask.shape, bool)
    borders[:-1] |= nearest[:-1] != nearest[1:]
    borders[:, :-1] |= nearest[:, :-1] != nearest[:, 1:]
    kept = ndimage.gaussian_filter(rng.normal(size=mask.shape), 10) > 0
    return outline | (borders & kept)


def lettered(rng: np.random.Generator, mask: AnyArray, outline: BoolArray) -> BoolArray:
    """Draw letters and arrows, as if burnt into the slice."""
    lines = np.zeros(mask.shape, np.uint8)
    for place in rng.permutation(np.argwhere(outline))[: rng.integers(1, 4)]:
        row, column = (place + rng.integers(-10, 11, 2)).tolist()
        text = "".join(rng.choice([*"ABRLHS12357"], 3))
        cv2.putText(lines, text, (column, row), cv2.FONT_HERSHEY_SIMPLEX, rng.uniform(0.4, 0.8), 1)
        tip = place[::-1]
        cv2.arrowedLine(lines, (tip + rng.integers(-25, 26, 2)).tolist(), tip.tolist(), 1)
    return outline | (lines > 0)


def interlaced(rng: np.random.Generator, mask: AnyArray, outline: BoolArray) -> BoolArray:
    """Shift bands of rows by a few pixels, as if the organ had moved between them."""
    observed = outline.copy()
    height, shift = int(rng.integers(8, 20)), int(rng.integers(2, 5) * rng.choice([-1, 1]))
    for top in range(int(rng.integers(0, 2 * height)), len(outline), 2 * height):
        band = slice(top, top + height)
        observed[band] = np.roll(outline[band], shift, axis=1)
    return observed


def calcified(rng: np.random.Generator, mask: AnyArray, outline: BoolArray) -> BoolArray:
    """Fill spots on the outline and next to it, and hide it in the shadows of some."""
    centres = np.zeros(mask.shape, np.uint8)
    observed = outline.copy()
    for place in rng.permutation(np.argwhere(outline))[: rng.integers(4, 12)]:
        row, column = np.clip(place + rng.integers(-3, 4, 2), 0, np.array(mask.shape) - 1)
        centres[row, column] = 1
        if rng.random() < 0.4:
            observed[max(row - 5, 0) : row + 6, column : column + 9] = False
    return observed | (distance_to_zero(1 - centres) <= rng.uniform(1.5, 4))


def _line(canvas: AnyArray, way: Sequence[AnyArray] | AnyArray) -> None:
    """Draw a polyline (N, 2) of (column, row)."""
    cv2.polylines(canvas, [np.rint(np.asarray(way)).astype(np.int32).reshape(-1, 1, 2)], False, 1)


#: Those of docs/out_of_distribution.csv.
FIRST_DAMAGES: dict[str, _Damage] = {
    damage.__name__: damage for damage in (thresholded, ghost, cutout, grid_mask, coarse, hatched)
}
DAMAGES: dict[str, _Damage] = FIRST_DAMAGES | {
    damage.__name__: damage
    for damage in (dashed, sparse, vessels, streaks, tiled, lettered, interlaced, calcified)
}
