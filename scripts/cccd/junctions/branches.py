"""Branches of a boundary map: the stretches of pixels between its junctions and its ends.

Strokes are branches that go on straight across junctions and gaps, as the eye follows them: the line that
crosses a border, and the border that it crosses.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from cccd.chaincode import DIRECTIONS

__all__ = ["BRANCH_MEASURES", "Branches", "find_branches", "join_nodes"]

# A branch's direction at a pixel is read off its pixels up to this far away.
_REACH_PX = 6

# Two ends are one stroke's if the cosine of the turn between them is at least so large, across a junction
# and across a gap; and if each has a direction at all.
_STRAIGHT = (0.7, 0.8)
_LEAST_DIRECTION = 0.3

# A branch between junctions no longer than this belongs to them.
_KNOT_PX = 3

#: Columns of `Branches.measures`, for branches and for strokes.
BRANCH_MEASURES = 5


@dataclass
class Branches:
    """Branches and strokes of a map's pixels.

    Attributes
    ----------
    labels : (2, N) int64 array
        Lowest pixel of the branch, and of the stroke, that each pixel is part of.
    measures : (N, 2 BRANCH_MEASURES) array
        Of each pixel's branch, then of its stroke: logarithm of its pixels; its dead ends; its pixels
        beside junctions (both up to 2); logarithms of its spread across and along its main direction:
        lines drawn by hand are straight, borders seldom.
    outward : (N, 2) array
        Where the branch points at each of its pixels: about 1 long at its ends, short in between.
    """

    labels: np.ndarray
    measures: np.ndarray
    outward: np.ndarray


def find_branches(pixels: np.ndarray, links: np.ndarray, gaps: np.ndarray) -> Branches:
    """Find branches and strokes.

    A junction is a pixel around which at least three runs of neighbours are met (Rutovitz 1966). Branches
    end before junctions; touching junctions are a branch of their own. At a junction, and across a gap,
    the ends that go on best in each other are joined first, each at most once.

    Parameters
    ----------
    pixels : (N, 2) int array
        Distinct pixels (i, j).
    links : (L, 2) int array
        Pairs of 8-neighbours that keep together what is 8-connected.
    gaps : (G, 2) int array
        Pairs of pixels across which a stroke may go on.
    """
    neighbour = _neighbours(pixels)
    present = neighbour >= 0
    runs = np.count_nonzero(present & ~np.roll(present, 1, axis=0), axis=0)
    junction = runs > 2
    dead_end = (runs < 2) & (np.count_nonzero(present, axis=0) < 3)
    # branches that leave a junction may touch each other diagonally beside it
    beside = (present & junction[neighbour]).any(axis=0)
    a, b = links.T
    alike = junction[a] == junction[b]
    branches = join_nodes(len(pixels), links[alike & (junction[a] | ~(beside[a] & beside[b]))])
    outward = _outward(pixels, branches)
    # what is left of a branch between two junctions side by side has no direction
    size = np.bincount(branches, minlength=len(pixels))
    free = np.bincount(branches, ~beside | dead_end, minlength=len(pixels))
    knot = junction | ((size <= _KNOT_PX) & (free == 0))[branches]
    strokes, loose = _strokes(pixels, branches, knot, dead_end, outward, links, gaps)
    measures = [_measure(pixels, branches, dead_end, beside), _measure(pixels, strokes, loose, beside)]
    return Branches(np.stack([branches, strokes]), np.hstack(measures), outward)


def _neighbours(pixels: np.ndarray) -> np.ndarray:
    """Index (8, N) of each pixel's neighbours by Freeman code, in turn around it; -1 where there is none."""
    low = pixels.min(axis=0) - 1
    raster = np.full(pixels.max(axis=0) - low + 2, -1)
    raster[tuple((pixels - low).T)] = np.arange(len(pixels))
    width = raster.shape[1]
    return raster.ravel()[(pixels - low) @ (width, 1) + (DIRECTIONS @ (width, 1))[:, None]]


def _strokes(
    pixels: np.ndarray,
    branches: np.ndarray,
    knot: np.ndarray,
    dead_end: np.ndarray,
    outward: np.ndarray,
    links: np.ndarray,
    gaps: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Lowest pixel (N,) of each pixel's stroke, and the dead ends (N,) that remain."""
    dead = np.flatnonzero(dead_end)
    place, owner, heading = _ends_at_knots(branches, knot, outward, links)
    met = len(owner)  # the ends at knots come first, then the dead ends
    owner = np.concatenate([owner, branches[dead]])
    heading = np.vstack([heading, outward[dead]])
    length = np.hypot(*heading.T)
    heading = heading * ((length >= _LEAST_DIRECTION) / np.maximum(length, 1e-9))[:, None]

    first, second = _pairs(place)
    straight = -np.einsum("pc,pc->p", heading[first], heading[second])

    faced = gaps[dead_end[gaps[:, 0]] & dead_end[gaps[:, 1]]]
    step = (pixels[faced[:, 1]] - pixels[faced[:, 0]]).astype(float)
    step /= np.hypot(*step.T)[:, None]
    one, other = (met + np.searchsorted(dead, faced[:, end]) for end in range(2))
    along = np.minimum(
        np.einsum("gc,gc->g", heading[one], step), np.einsum("gc,gc->g", heading[other], -step)
    )

    first, second = np.concatenate([first, one]), np.concatenate([second, other])
    fit = np.concatenate([straight, along])
    good = np.flatnonzero(fit > np.repeat(_STRAIGHT, [len(straight), len(along)]))
    best = good[np.argsort(-fit[good], kind="stable")]
    used, joined = _match(first[best], second[best], len(owner))
    pairs = np.column_stack([owner[first[best]], owner[second[best]]])
    loose = dead_end.copy()
    loose[dead[used[met:]]] = False
    return join_nodes(len(pixels), pairs[joined])[branches], loose


def _ends_at_knots(
    branches: np.ndarray, knot: np.ndarray, outward: np.ndarray, links: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Knot and branch (E,) of each end of a branch at a knot, by knots, and where it points (E, 2)."""
    count = len(branches)
    a, b = links.T
    knots = join_nodes(count, links[knot[a] & knot[b]])
    across = links[knot[a] != knot[b]]
    tip, at = np.where(knot[across[:, :1]], across[:, ::-1], across).T
    keys, end = np.unique(knots[at] * count + branches[tip], return_inverse=True)
    size = np.bincount(end, minlength=len(keys))
    heading = [np.bincount(end, outward[tip, axis], minlength=len(keys)) / size for axis in range(2)]
    return keys // count, keys % count, np.column_stack(heading)


def _measure(pixels: np.ndarray, group: np.ndarray, dead_end: np.ndarray, beside: np.ndarray) -> np.ndarray:
    """Measures (N, BRANCH_MEASURES) of the group that each pixel is part of."""

    def total(values):
        return np.bincount(group, values, minlength=len(pixels))

    count = np.maximum(total(np.ones(len(pixels))), 1)
    i, j = (pixels - pixels.mean(axis=0)).T
    mean_i, mean_j = total(i) / count, total(j) / count
    di, dj = i - mean_i[group], j - mean_j[group]
    ii, jj, ij = total(di * di) / count, total(dj * dj) / count, total(di * dj) / count
    half, apart = (ii + jj) / 2, np.hypot((ii - jj) / 2, ij)
    measures = np.column_stack(
        [
            np.log(count) / 4,
            np.minimum(total(dead_end), 2) / 2,
            np.minimum(total(beside), 2) / 2,
            np.log(np.sqrt(np.maximum(half - apart, 0)) + 0.2),
            np.log(np.sqrt(half + apart) + 0.2) / 4,
        ]
    )
    return measures[group]


def _outward(pixels: np.ndarray, branches: np.ndarray) -> np.ndarray:
    """Where a branch points at each of its pixels (N, 2)."""
    low = pixels.min(axis=0) - _REACH_PX
    raster = np.full(pixels.max(axis=0) - low + 1 + _REACH_PX, -1, np.int32)
    raster[tuple((pixels - low).T)] = branches
    return _away(raster, pixels - low, _REACH_PX) * (2 / _REACH_PX)


@numba.njit(cache=True)
def _away(raster, places, reach):
    # from the mean place of the branch's pixels in a window to the pixel
    away = np.zeros((len(places), 2))
    for n in range(len(places)):
        i, j = places[n]
        own = raster[i, j]
        count = 0
        for di in range(-reach, reach + 1):
            for dj in range(-reach, reach + 1):
                if raster[i + di, j + dj] == own:
                    away[n, 0] -= di
                    away[n, 1] -= dj
                    count += 1
        away[n] /= count
    return away


@numba.njit(cache=True)
def join_nodes(count, links):
    """Lowest node (count,) of all that links (L, 2) join with each: union-find with path halving."""
    above = np.arange(count)
    for n in range(len(links)):
        a, b = links[n]
        while above[a] != a:
            above[a] = above[above[a]]
            a = above[a]
        while above[b] != b:
            above[b] = above[above[b]]
            b = above[b]
        above[max(a, b)] = min(a, b)
    for node in range(count):
        above[node] = above[above[node]]
    return above


@numba.njit(cache=True)
def _pairs(place):
    # all pairs of ends at the same place, which stand together
    count, total = len(place), 0
    for _ in range(2):  # first counted, then written
        one, other = np.empty(total, np.int64), np.empty(total, np.int64)
        written = 0
        for a in range(count):
            b = a + 1
            while b < count and place[b] == place[a]:
                if written < total:
                    one[written], other[written] = a, b
                written += 1
                b += 1
        total = written
    return one, other


@numba.njit(cache=True)
def _match(first, second, count):
    # greedily, each end once
    used = np.zeros(count, np.bool_)
    joined = np.zeros(len(first), np.bool_)
    for n in range(len(first)):
        if not used[first[n]] and not used[second[n]]:
            used[first[n]] = used[second[n]] = True
            joined[n] = True
    return used, joined
