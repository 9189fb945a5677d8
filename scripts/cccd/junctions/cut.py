"""Inside or outside for every triangle: an exact minimum cut per slice."""

from __future__ import annotations

import numba
import numpy as np

__all__ = ["minimum_cut"]


def minimum_cut(
    inside_gain: np.ndarray,
    link_cost: np.ndarray,
    neighbours: np.ndarray,
    side_links: np.ndarray,
    offsets: np.ndarray,
) -> np.ndarray:
    """Label cells so that lost gains plus the costs of links between unlike cells are least.

    Parameters
    ----------
    inside_gain : (T,) array
        What labelling a cell inside gains over outside; negative where outside is better.
    link_cost : (L,) array, not negative
        Cost of the border running along a link.
    neighbours, side_links : (T, 3) int32 arrays
        See `cccd.junctions.complexes.Complex`.
    offsets : (S + 1,) int64 array
        Slices are independent of each other; the batch is solved slice by slice.

    Returns
    -------
    (T,) bool array
        Inside. Of several least cuts, the one with the smallest inside.

    Notes
    -----
    Maximum flow by Dinic (1970) with shortest augmenting paths; by the max-flow min-cut theorem the
    cells that the source still reaches are inside (Greig, Porteous and Seheult 1989).
    """
    return _cut(
        np.ascontiguousarray(inside_gain, np.float64),
        np.ascontiguousarray(link_cost, np.float64),
        neighbours,
        side_links,
        offsets,
    )


@numba.njit(cache=True)
def _cut(gain, cost, neighbours, side_links, offsets):
    count = len(gain)
    tiny = 1e-9
    inside = np.zeros(count, np.bool_)
    residual = np.zeros((count, 3))
    back = np.zeros((count, 3), np.int8)  # the neighbour's side that leads here
    for cell in range(count):
        for side in range(3):
            beyond = neighbours[cell, side]
            if beyond >= 0:
                residual[cell, side] = cost[side_links[cell, side]]
                for other in range(3):
                    if neighbours[beyond, other] == cell:
                        back[cell, side] = other
    source = np.maximum(gain, 0.0)
    sink = np.maximum(-gain, 0.0)
    level = np.empty(count, np.int32)
    turn = np.empty(count, np.int8)
    queue = np.empty(count, np.int32)
    path = np.empty(count + 1, np.int32)
    for part in range(len(offsets) - 1):
        low, high = offsets[part], offsets[part + 1]
        while True:
            level[low:high] = -1
            turn[low:high] = 0
            head, tail = 0, 0
            for cell in range(low, high):
                if source[cell] > tiny:
                    level[cell] = 0
                    queue[tail] = cell
                    tail += 1
            reached = False
            while head < tail:
                cell = queue[head]
                head += 1
                if sink[cell] > tiny:
                    reached = True
                for side in range(3):
                    beyond = neighbours[cell, side]
                    if beyond >= 0 and level[beyond] < 0 and residual[cell, side] > tiny:
                        level[beyond] = level[cell] + 1
                        queue[tail] = beyond
                        tail += 1
            if not reached:
                break
            for start in range(low, high):
                # blocking flow: walk forward along rising levels, step back at dead ends
                while level[start] == 0 and source[start] > tiny:
                    path[0] = start
                    depth = 0
                    while True:
                        cell = path[depth]
                        if sink[cell] > tiny:
                            break
                        moved = False
                        while turn[cell] < 3:
                            side = turn[cell]
                            beyond = neighbours[cell, side]
                            if (
                                beyond >= 0
                                and residual[cell, side] > tiny
                                and level[beyond] == level[cell] + 1
                            ):
                                depth += 1
                                path[depth] = beyond
                                moved = True
                                break
                            turn[cell] += 1
                        if not moved:
                            if depth == 0:
                                break
                            depth -= 1
                            turn[path[depth]] += 1
                    cell = path[depth]
                    if sink[cell] <= tiny:
                        break
                    flow = min(source[start], sink[cell])
                    for step in range(depth):
                        flow = min(flow, residual[path[step], turn[path[step]]])
                    source[start] -= flow
                    sink[cell] -= flow
                    for step in range(depth):
                        here, side = path[step], turn[path[step]]
                        residual[here, side] -= flow
                        residual[path[step + 1], back[here, side]] += flow
        for cell in range(low, high):
            inside[cell] = level[cell] >= 0
    return inside
