"""The paper's graph of a slice, and its decoder: the pixel grid, two links per pixel, chains followed.

Nodes are the boundary map's pixels (+1) and the pixels around them (-1), as far as they can tell anything;
each is linked to its eight neighbours (Figure 3). A chain code can run along links between pixels of the map
only: these are the candidates, of which the network scores each. Section 4.2 wants "at most two adjacent
neighbors", and to "remove unwanted links (more than two neighbors)". So a pixel with more than two keeps the
two of the highest scores, whatever their sign. What is then closed and simple is a curve. Everything else is
dropped: nothing bridges a gap.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Protocol, runtime_checkable

import numpy as np

from cccd.geometry._jit import jit
from cccd.geometry.arrays import AnyArray, BoolArray, FloatArray, IntArray, offsets_of, split_ragged
from cccd.geometry.polygons import RaggedPolygons

# Steps to four of the eight neighbours; the other four lead back.
_STEPS = ((0, 1), (1, -1), (1, 0), (1, 1))

# A chain of fewer pixels encloses nothing.
_SHORTEST = 4


@dataclass(frozen=True, eq=False)
class GridGraph:
    """Part of the pixel grid of one slice.

    Attributes
    ----------
    pixels : (V, 2) int64
        Nodes (i, j): first the boundary map's, in their order, then the pixels around them.
    observed : (V,) bool
        Whether a node is a pixel of the boundary map.
    links : (L, 2) int64
        Pairs of 8-neighbours, each once.
    candidates : (C, 2) int64
        Those of two pixels of the map.
    """

    pixels: IntArray
    observed: BoolArray
    links: IntArray
    candidates: IntArray

    @property
    def has_junctions(self) -> bool:
        """Whether a pixel of the map has more than two neighbours in it: only then a network is asked."""
        return bool((np.bincount(self.candidates.ravel()) > 2).any())


@runtime_checkable
class LinkPredictor(Protocol):
    """What scores links between neighbouring pixels: the paper's network."""

    def link_scores(self, grids: Sequence[GridGraph]) -> list[FloatArray]:
        """Scores (C,) of every grid's candidates, higher for true links."""
        ...


def build_grid(pixels: AnyArray) -> GridGraph:
    """Link one slice's boundary pixels (N, 2), and the pixels beside them, to their neighbours.

    Examples
    --------
    >>> grid = build_grid(np.array([(5, 5), (5, 6), (6, 6)]))
    >>> len(grid.pixels), grid.candidates.tolist(), grid.has_junctions
    (15, [[0, 1], [1, 2], [0, 2]], False)
    """
    origin = pixels.min(axis=0) - 2
    shape = pixels.max(axis=0) + 3 - origin
    number = np.full(shape, -1, np.int64)
    at = (pixels - origin).astype(np.int64)
    for step in product((-1, 0, 1), repeat=2):
        number[tuple((at + step).T)] = -2
    number[tuple(at.T)] = np.arange(len(at))
    beside = np.argwhere(number == -2)
    number[tuple(beside.T)] = len(at) + np.arange(len(beside))
    nodes = np.concatenate([at, beside])
    links: list[IntArray] = []
    for step in _STEPS:
        there = number[tuple((nodes + step).T)]
        here = np.flatnonzero(there >= 0)
        links.append(np.column_stack([here, there[here]]))
    every = np.concatenate(links)
    observed = np.arange(len(nodes)) < len(at)
    return GridGraph(nodes + origin, observed, every, every[observed[every].all(axis=1)])


def find_chains(grid: GridGraph, scores: FloatArray | None) -> list[IntArray]:
    """Keep two links per pixel and follow the chains; without scores (C,) all links count alike.

    Returns
    -------
    list of (n, 2) int64
        Closed simple chains of 8-connected pixels. Chains that end at an isolated corner (Figure 4), that
        cross or touch themselves, or enclose nothing are dropped.
    """
    value = np.ones(len(grid.candidates)) if scores is None else scores
    kept = grid.candidates[keep_two(grid.candidates, value, len(grid.pixels))]
    chains, closed = follow_chains(kept, len(grid.pixels))
    rings = [grid.pixels[chain] for chain, whole in zip(chains, closed, strict=True) if whole]
    simple = RaggedPolygons.of([ring.astype(float) for ring in rings]).is_simple
    return [ring for ring, good in zip(rings, simple, strict=True) if good and len(ring) >= _SHORTEST]


def chain_loops(maps: Sequence[AnyArray], predictor: LinkPredictor) -> list[list[IntArray]]:
    """Follow the chains of each map (N, 2); the predictor is asked of maps that have junctions."""
    grids = [build_grid(pixels) for pixels in maps]
    doubtful = [grid for grid in grids if grid.has_junctions]
    scores = iter(predictor.link_scores(doubtful) if doubtful else [])
    return [find_chains(grid, next(scores) if grid.has_junctions else None) for grid in grids]


def keep_two(links: IntArray, scores: FloatArray, count: int) -> BoolArray:
    """Say which links (L,) are kept: highest first, while both ends have fewer than two."""
    return _keep_two(links, np.argsort(-scores, kind="stable"), count)


@jit
def _keep_two(links: IntArray, order: IntArray, count: int) -> BoolArray:
    kept = np.zeros(len(links), np.bool_)
    degree = np.zeros(count, np.int64)
    for n in order:
        a, b = links[n]
        if degree[a] < 2 and degree[b] < 2:
            kept[n] = True
            degree[a] += 1
            degree[b] += 1
    return kept


def follow_chains(links: IntArray, count: int) -> tuple[list[IntArray], BoolArray]:
    """Nodes along every chain of links (L, 2), no node in more than two; and whether it comes back (C,)."""
    order, sizes, closed = _follow(np.ascontiguousarray(links, np.int64), count)
    return split_ragged(order, offsets_of(sizes)), closed


@jit
def _follow(links: IntArray, count: int) -> tuple[IntArray, IntArray, BoolArray]:
    beside = np.full((count, 2), -1, np.int64)
    for n in range(len(links)):
        a, b = links[n]
        beside[a, 0 if beside[a, 0] < 0 else 1] = b
        beside[b, 0 if beside[b, 0] < 0 else 1] = a
    done = np.zeros(count, np.bool_)
    order = np.empty(count, np.int64)
    sizes = np.zeros(count, np.int64)
    closed = np.zeros(count, np.bool_)
    written, chains = 0, 0
    for rings in range(2):  # open chains from their ends first; what is left comes back to its start
        for start in range(count):
            if done[start] or beside[start, 0] < 0 or (rings == 0 and beside[start, 1] >= 0):
                continue
            here = start
            while here >= 0:
                done[here] = True
                order[written] = here
                written += 1
                sizes[chains] += 1
                ahead = beside[here, 0]
                if ahead >= 0 and done[ahead]:
                    ahead = beside[here, 1]
                here = -1 if ahead < 0 or done[ahead] else ahead
            closed[chains] = rings == 1
            chains += 1
    return order[:written], sizes[:chains], closed[:chains]
