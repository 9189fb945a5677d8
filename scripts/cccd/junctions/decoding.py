"""From labelled triangles to closed, strictly simple pixel chains: a result for any labelling."""

from __future__ import annotations

import cv2
import numba
import numpy as np

from cccd.junctions.complexes import Complex

__all__ = ["border_loops", "fill_inside"]


def border_loops(graph: Complex, inside: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Trace closed loops of links that part inside from outside triangles.

    Parameters
    ----------
    graph : Complex
    inside : (T,) bool array

    Returns
    -------
    nodes : (N,) int64 array
        Nodes along the loops, inside on the left.
    offsets : (C + 1,) int64 array
    slices : (C,) int64 array
        Slice of each loop, ascending.
    """
    nodes, ends, first = _loops(graph.triangles, graph.neighbours, np.ascontiguousarray(inside))
    slices = np.searchsorted(graph.triangle_offsets, first, side="right") - 1
    return nodes, np.concatenate([[0], ends]), slices


def fill_inside(graph: Complex, inside: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pixels enclosed by the border of the inside triangles, the border's own pixels included.

    Gap links become lines of 8-connected pixels (Bresenham 1965).

    Returns
    -------
    masks : (S, I, J) bool array
    origin : (2,) int64 array
        Pixel (i, j) of ``masks[:, 0, 0]``.
    """
    pixels = graph.points[~graph.ring].astype(np.int64)
    origin = pixels.min(axis=0) - 1
    shape = pixels.max(axis=0) + 2 - origin
    count = len(graph.triangle_offsets) - 1
    masks = np.zeros((count, *shape), np.uint8)
    nodes, offsets, slices = border_loops(graph, inside)
    corners = (graph.points[nodes].astype(np.int64) - origin)[:, ::-1].astype(np.int32)
    loops = np.split(corners, offsets[1:-1]) if len(slices) else []
    parts = np.searchsorted(slices, np.arange(count + 1))
    for layer in range(count):
        if parts[layer] < parts[layer + 1]:
            cv2.fillPoly(masks[layer], loops[parts[layer] : parts[layer + 1]], 1)
    return masks.astype(bool), origin


@numba.njit(cache=True)
def _loops(triangles, neighbours, inside):
    # half-edges lie opposite a triangle's node; the successor is found by turning around the head node
    count = len(triangles)
    done = np.zeros((count, 3), np.bool_)
    nodes = np.empty(3 * count, np.int64)
    ends = np.empty(count, np.int64)
    first = np.empty(count, np.int64)
    written, loops = 0, 0
    for start in range(count):
        if not inside[start]:
            continue
        for start_side in range(3):
            beyond = neighbours[start, start_side]
            if done[start, start_side] or (beyond >= 0 and inside[beyond]):
                continue
            first[loops] = start
            cell, side = start, start_side
            while not done[cell, side]:
                done[cell, side] = True
                nodes[written] = triangles[cell, (side + 1) % 3]
                written += 1
                head = triangles[cell, (side + 2) % 3]
                while True:  # the next side at the head, in the same triangle, then across it if inside
                    turn = 0
                    while triangles[cell, (turn + 1) % 3] != head:
                        turn += 1
                    beyond = neighbours[cell, turn]
                    side = turn
                    if beyond < 0 or not inside[beyond]:
                        break
                    cell = beyond
            ends[loops] = written
            loops += 1
    return nodes[:written], ends[:loops], first[:loops]
