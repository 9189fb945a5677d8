"""Branches of a boundary map: the stretches of pixels between its junctions and its ends.

Good-continuation groups are branches that go on straight across junctions and gaps, as the eye follows them
(Wertheimer 1923): the line that crosses a border, and the border that it crosses.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from cccd.chaincode import DIRECTIONS
from cccd.geometry._jit import jit
from cccd.geometry.arrays import AnyArray, BoolArray, FloatArray, IntArray, connected_parts, ranks_of
from cccd.tolerances import ROUNDING
from cccd_junctions.columns import FeatureSchema

# A branch's direction at a pixel is read off its pixels up to this far away.
_REACH_PX = 6

# Two ends continue each other if the cosine of the turn between them is at least so large, across a junction
# and across a gap; and if each has a direction at all.
_STRAIGHT = (0.7, 0.8)
_LEAST_DIRECTION = 0.3

# A branch between junctions no longer than this belongs to their cluster.
_CLUSTER_PX = 3

#: What is measured of a branch, and of a group: lines drawn by hand are straight, borders seldom.
SHAPE_COLUMNS = FeatureSchema(
    size=1,  # log pixels / 4
    dead_ends=1,  # its dead ends / 2, 2 at most
    junction_contacts=1,  # its pixels next to junctions / 2, 2 at most
    spread_across=1,  # log pixels: spread across its main direction (RMS, and 0.2)
    spread_along=1,  # log pixels / 4: spread along its main direction (RMS, and 0.2)
)


@dataclass(frozen=True, eq=False)
class Branches:
    """Branches and good-continuation groups of a boundary map's pixels.

    Attributes
    ----------
    branch, group : (N,) int64 array
        Lowest pixel of the branch, and of the group, that each pixel is part of.
    branch_shape, group_shape : (N, SHAPE_COLUMNS.width) array
        `SHAPE_COLUMNS` of each pixel's branch, and of its group.
    outward : (N, 2) array
        Where the branch points at each of its pixels: about 1 long at its ends, short in between.
    """

    branch: IntArray
    group: IntArray
    branch_shape: FloatArray
    group_shape: FloatArray
    outward: FloatArray


def find_branches(pixels: AnyArray, links: AnyArray, gaps: AnyArray) -> Branches:
    """Find branches and good-continuation groups.

    A junction is a pixel around which at least three runs of neighbours are met (Rutovitz 1966). Branches
    end before junctions; touching junctions are a branch of their own. At a junction cluster, and across a
    gap, the ends that continue each other best are joined first, each at most once.

    Parameters
    ----------
    pixels : (N, 2) int array
        Distinct pixels (i, j).
    links : (L, 2) int array
        Pairs of 8-neighbours that keep together what is 8-connected.
    gaps : (G, 2) int array
        Pairs of pixels across which a group may go on.
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
    branch = connected_nodes(len(pixels), links[alike & (junction[a] | ~(beside[a] & beside[b]))])
    outward = _outward(pixels, branch)
    # what is left of a branch between two junctions side by side has no direction
    size = np.bincount(branch, minlength=len(pixels))
    free = np.bincount(branch, ~beside | dead_end, minlength=len(pixels))
    cluster = junction | ((size <= _CLUSTER_PX) & (free == 0))[branch]
    ends = _ends(branch, cluster, dead_end, outward, links)
    pairs = _continuations(ends, pixels, dead_end, gaps)
    group = connected_nodes(len(pixels), ends.branch[pairs])[branch]
    loose = dead_end.copy()
    loose[ends.pixel[pairs[ends.pixel[pairs] >= 0]]] = False
    return Branches(
        branch, group, _shape(pixels, branch, dead_end, beside), _shape(pixels, group, loose, beside), outward
    )


def _neighbours(pixels: AnyArray) -> IntArray:
    """Index (8, N) of each pixel's neighbours by Freeman code, in turn around it; -1 where there is none."""
    low = pixels.min(axis=0) - 1
    rows, width = pixels.max(axis=0) - low + 2
    raster = np.full((rows, width), -1)
    raster[tuple((pixels - low).T)] = np.arange(len(pixels))
    return raster.ravel()[(pixels - low) @ (width, 1) + (DIRECTIONS @ (width, 1))[:, None]]


@dataclass(frozen=True, eq=False)
class _Ends:
    """Ends of branches: those at junction clusters, cluster by cluster, then the dead ends by pixel."""

    branch: IntArray  # (E,)
    cluster: IntArray  # (E,) -1 for dead ends
    pixel: IntArray  # (E,) dead ends' own; -1 at clusters
    heading: FloatArray  # (E, 2) unit vector, or zero for ends without a direction


def _ends(
    branch: IntArray, cluster: BoolArray, dead_end: BoolArray, outward: FloatArray, links: AnyArray
) -> _Ends:
    count = len(branch)
    a, b = links.T
    cluster_of = connected_nodes(count, links[cluster[a] & cluster[b]])
    across = links[cluster[a] != cluster[b]]
    tip, at = np.where(cluster[across[:, :1]], across[:, ::-1], across).T
    keys, end = np.unique(cluster_of[at] * count + branch[tip], return_inverse=True)
    size = np.bincount(end, minlength=len(keys))
    mean = [np.bincount(end, outward[tip, axis], minlength=len(keys)) / size for axis in range(2)]
    dead = np.flatnonzero(dead_end)
    heading = np.vstack([np.column_stack(mean), outward[dead]])
    length = np.hypot(*heading.T)
    return _Ends(
        np.concatenate([keys % count, branch[dead]]),
        np.concatenate([keys // count, np.full(len(dead), -1)]),
        np.concatenate([np.full(len(keys), -1), dead]),
        heading * ((length >= _LEAST_DIRECTION) / np.maximum(length, ROUNDING))[:, None],
    )


def _continuations(ends: _Ends, pixels: AnyArray, dead_end: BoolArray, gaps: AnyArray) -> IntArray:
    """Pairs (P, 2) of ends that continue each other, at a junction cluster or across a gap."""
    at_clusters = _pairs_at_one_place(ends.cluster[ends.cluster >= 0])
    one, other = (ends.heading[at_clusters[:, end]] for end in range(2))
    straight = -np.einsum("pc,pc->p", one, other)

    faced = gaps[dead_end[gaps[:, 0]] & dead_end[gaps[:, 1]]]
    across = np.searchsorted(ends.pixel, faced)  # -1 of the other ends comes first
    step = (pixels[faced[:, 1]] - pixels[faced[:, 0]]).astype(float)
    step /= np.hypot(*step.T)[:, None]
    one, other = (ends.heading[across[:, end]] for end in range(2))
    along = np.minimum(np.einsum("gc,gc->g", one, step), np.einsum("gc,gc->g", other, -step))

    pairs, fit = np.concatenate([at_clusters, across]), np.concatenate([straight, along])
    good = np.flatnonzero(fit > np.repeat(_STRAIGHT, [len(straight), len(along)]))
    best = pairs[good[np.argsort(-fit[good], kind="stable")]]
    return best[_match(best, len(ends.branch))]


def _shape(pixels: AnyArray, part: IntArray, dead_end: BoolArray, beside: BoolArray) -> FloatArray:
    """`SHAPE_COLUMNS` (N, width) of the part that each pixel belongs to."""

    def total(values: AnyArray) -> FloatArray:
        return cast(FloatArray, np.bincount(part, values, minlength=len(pixels)))

    count = np.maximum(total(np.ones(len(pixels))), 1)
    i, j = (pixels - pixels.mean(axis=0)).T
    mean_i, mean_j = total(i) / count, total(j) / count
    di, dj = i - mean_i[part], j - mean_j[part]
    ii, jj, ij = total(di * di) / count, total(dj * dj) / count, total(di * dj) / count
    half, apart = (ii + jj) / 2, np.hypot((ii - jj) / 2, ij)
    shape = {
        "size": np.log(count) / 4,
        "dead_ends": np.minimum(total(dead_end), 2) / 2,
        "junction_contacts": np.minimum(total(beside), 2) / 2,
        "spread_across": np.log(np.sqrt(np.maximum(half - apart, 0)) + 0.2),
        "spread_along": np.log(np.sqrt(half + apart) + 0.2) / 4,
    }
    return SHAPE_COLUMNS.assemble(shape, np.float64)[part]


def _outward(pixels: AnyArray, branch: IntArray) -> FloatArray:
    """Where a branch points at each of its pixels (N, 2)."""
    low = pixels.min(axis=0) - _REACH_PX
    raster = np.full(pixels.max(axis=0) - low + 1 + _REACH_PX, -1, np.int32)
    raster[tuple((pixels - low).T)] = branch
    i, j = (pixels - low - _REACH_PX).T
    window = np.arange(-_REACH_PX, _REACH_PX + 1)
    around = sliding_window_view(raster, (len(window), len(window)))[i, j]
    own = (around == branch[:, None, None]).reshape(len(pixels), -1).astype(float)
    steps = np.stack(np.meshgrid(window, window, indexing="ij"), axis=-1).reshape(-1, 2)
    from_mean = -(own @ steps) / own.sum(axis=1, keepdims=True)
    return from_mean * (2 / _REACH_PX)


def connected_nodes(count: int, links: AnyArray) -> IntArray:
    """Lowest node (count,) of all that links (L, 2) join with each.

    Examples
    --------
    >>> connected_nodes(5, np.array([[4, 2], [0, 1]])).tolist()
    [0, 0, 2, 3, 2]
    """
    part = connected_parts(links[:, 0], links[:, 1], count)
    _, lowest = np.unique(part, return_index=True)
    return lowest[part]


def _pairs_at_one_place(place: IntArray) -> IntArray:
    """Find all pairs (P, 2) of ends at the same place (E,); ends of one place stand together."""
    last = np.searchsorted(place, place, side="right")
    after = last - np.arange(len(place)) - 1
    first = np.repeat(np.arange(len(place)), after)
    return np.column_stack([first, first + 1 + ranks_of(after)])


@jit
def _match(pairs: IntArray, count: int) -> BoolArray:
    # which pairs (P,) are joined, greedily in order, each of the ends once
    used = np.zeros(count, np.bool_)
    joined = np.zeros(len(pairs), np.bool_)
    for n in range(len(pairs)):
        first, second = pairs[n]
        if not used[first] and not used[second]:
            used[first] = used[second] = True
            joined[n] = True
    return joined
