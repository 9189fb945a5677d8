"""From labelled triangles to closed, strictly simple pixel chains: a result for any labelling."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from cccd.containers import Curves, Frame
from cccd.contours import trace_stack
from cccd.geometry._jit import jit
from cccd.geometry.arrays import AnyArray, BoolArray, IntArray, concatenate_ragged, offsets_of, split_ragged
from cccd_junctions.boundary import outline
from cccd_junctions.delaunay import DelaunayGraph, any_corner

#: Smaller loops, and fragments of fewer pixels, are debris: the loop of eight pixels around one encloses
#: four.
SMALLEST_LOOP_PX = 6.0

# So are loops smaller than this share of their slice's largest: specks beside an organ are seldom part of it.
_SMALLEST_LOOP_SHARE = 0.005

# Pixels that a map may have beyond an outline, which is then taken as it is: of 0, 1, 2 and 5 the best on
# real slices and two synthetic test sets.
_TIP_PX = 1


@dataclass(frozen=True, eq=False)
class Outline:
    """What 8-neighbours of a boundary map enclose.

    Attributes
    ----------
    enclosed : (T,) bool
        Triangles that are enclosed an odd number of times.
    exact : bool
        Whether the map is just the outline of these. Fragments as small as debris are left out, and an
        outline may end in a tip of a pixel, which encloses nothing.
    """

    enclosed: BoolArray
    exact: bool


def find_outline(graph: DelaunayGraph) -> Outline:
    """Find what a slice's boundary map encloses already, and whether nothing else is in it."""
    fragment = graph.fragments
    debris = graph.observed & (np.bincount(fragment)[fragment] < SMALLEST_LOOP_PX)
    enclosed = (graph.depths[:, 0] % 2 == 1) & ~any_corner(debris, graph.triangles)
    masks, origin = fill_inside(graph, enclosed)
    observed = np.zeros_like(masks[0])
    i, j = (graph.points[graph.observed & ~debris].astype(np.int64) - origin).T
    observed[i, j] = True
    around = outline(masks)[0]
    left = np.count_nonzero(observed & ~around)
    return Outline(enclosed, bool(masks.any() and (around <= observed).all() and left <= _TIP_PX))


def border_loops(graph: DelaunayGraph, inside: BoolArray) -> list[IntArray]:
    """Trace the closed loops of links between inside and outside triangles.

    Parameters
    ----------
    graph : DelaunayGraph
    inside : (T,) bool array

    Returns
    -------
    list of (n, 2) int64 array
        Pixels (i, j) along the loops, inside on the left.
    """
    nodes, sizes = _trace(graph.triangles, graph.neighbours, np.ascontiguousarray(inside))
    return split_ragged(graph.points[nodes].astype(np.int64), offsets_of(sizes))


@jit
def _trace(triangles: AnyArray, neighbours: AnyArray, inside: BoolArray) -> tuple[IntArray, IntArray]:
    # half-edges lie opposite a triangle's node; nodes along all loops, and the loops' sizes
    count = len(triangles)
    done = np.zeros((count, 3), np.bool_)
    nodes = np.empty(3 * count, np.int64)
    sizes = np.zeros(count, np.int64)
    written, loops = 0, 0
    for start in range(3 * count):
        cell, side = start // 3, start % 3
        beyond = neighbours[cell, side]
        if not inside[cell] or done[cell, side] or (beyond >= 0 and inside[beyond]):
            continue
        while not done[cell, side]:
            done[cell, side] = True
            nodes[written] = triangles[cell, (side + 1) % 3]
            written += 1
            sizes[loops] += 1
            cell, side = _following(cell, side, triangles, neighbours, inside)
        loops += 1
    return nodes[:written], sizes[:loops]


@jit
def _following(
    cell: int, side: int, triangles: AnyArray, neighbours: AnyArray, inside: BoolArray
) -> tuple[int, int]:
    # the border's next half-edge: the next side at the head node, in the same triangle or across it if inside
    head = triangles[cell, (side + 2) % 3]
    while True:
        turn = 0
        while triangles[cell, (turn + 1) % 3] != head:
            turn += 1
        beyond = neighbours[cell, turn]
        if beyond < 0 or not inside[beyond]:
            return cell, turn
        cell = beyond


def fill_loops(loops: Sequence[Sequence[IntArray]], origin: IntArray, shape: Sequence[int]) -> BoolArray:
    """Pixels (S, I, J) enclosed by each slice's loops, the loops' own pixels included.

    Gap links become lines of 8-connected pixels (Bresenham 1965). ``origin`` is the pixel of
    ``masks[:, 0, 0]``.
    """
    masks = np.zeros((len(loops), *shape), np.uint8)
    for mask, around in zip(masks, loops, strict=True):
        if around:
            cv2.fillPoly(mask, [(loop - origin)[:, ::-1].astype(np.int32) for loop in around], 1)
    return masks.astype(bool)


def fill_inside(graph: DelaunayGraph, *inside: BoolArray) -> tuple[BoolArray, IntArray]:
    """Pixels enclosed by the border of the inside triangles (T,), the border's own pixels included.

    Returns
    -------
    masks : (K, I, J) bool array
        One for each of the K labellings given.
    origin : (2,) int64 array
        Pixel (i, j) of ``masks[:, 0, 0]``.
    """
    pixels = graph.points[~graph.ghost].astype(np.int64)
    origin = pixels.min(axis=0) - 1
    shape = pixels.max(axis=0) + 2 - origin
    return fill_loops([border_loops(graph, one) for one in inside], origin, shape), origin


def closed_chains(
    masks: BoolArray, origin: IntArray, numbers: AnyArray, frame: Frame, parts: int | None = None
) -> Curves:
    """Strictly simple closed pixel chains around masks, without debris.

    Parameters
    ----------
    masks : (S, I, J) bool array
    origin : (2,) int array
        Source pixel (i, j) of ``masks[:, 0, 0]``.
    numbers : (S,) int array
        Source slice k of each mask.
    frame : Frame
        Of the source volume.
    parts : int, optional
        How many there may be on a slice; of more the largest stay, without holes.
    """
    traced = trace_stack(masks, (0, *origin), frame)
    area = np.abs(traced.polygons.signed_areas)
    largest = np.zeros(len(masks))
    np.maximum.at(largest, traced.slice, area)
    debris = np.maximum(SMALLEST_LOOP_PX, _SMALLEST_LOOP_SHARE * largest)
    kept = area >= debris[traced.slice]
    if parts is not None:
        kept &= ~traced.hole
        among = np.where(kept, np.cumsum(kept), 0)  # larger ones first within a slice
        before = np.concatenate([[0], np.cumsum(kept)])[np.searchsorted(traced.slice, traced.slice)]
        kept &= among - before <= parts
    points, offsets = concatenate_ragged([loop for loop, keep in zip(traced, kept, strict=True) if keep])
    numbers = np.asarray(numbers, np.int32)[traced.slice[kept]]
    return Curves(points, offsets, numbers, traced.hole[kept], frame)
