"""Inside or outside for every triangle: an exact minimum cut."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cccd.geometry._jit import jit
from cccd.geometry.arrays import AnyArray, BoolArray, FloatArray, RealArray

#: Capacities up to this are used up when a minimum cut is sought (energies are of the order of one).
_FLOW = 1e-9


def minimum_cuts(
    unaries: Sequence[RealArray] | RealArray,
    pairwise: RealArray,
    neighbours: AnyArray,
    triangle_links: AnyArray,
) -> BoolArray:
    """Label triangles so that unary energies inside and pairwise ones along the border are least.

    Parameters
    ----------
    unaries : (K, T) array
        What a triangle inside costs; negative where inside is better. Each of the K is cut by itself.
    pairwise : (L,) array, not negative
        What the border costs where it runs along a link.
    neighbours, triangle_links : (T, 3) int32 arrays
        See `cccd_junctions.delaunay.DelaunayGraph`.

    Returns
    -------
    (K, T) bool array
        Inside. Of several least cuts, the one with the smallest inside.

    Notes
    -----
    Maximum flow by Dinic (1970) with shortest augmenting paths; by the max-flow min-cut theorem the
    triangles that the source still reaches are inside (Greig, Porteous and Seheult 1989). Each cut goes on
    from the flow of the one before, so that energies that differ little cost little more than one (Kohli and
    Torr 2007). `scipy.sparse.csgraph.maximum_flow` takes whole-number capacities only.

    Examples
    --------
    Two triangles side by side: the second follows the first where the link between them costs more.

    >>> neighbours = np.array([(1, -1, -1), (0, -1, -1)])
    >>> links = np.array([(0, -1, -1), (0, -1, -1)])
    >>> [minimum_cuts([[-2, 1]], [cost], neighbours, links)[0].tolist() for cost in (0.5, 1.5)]
    [[True, False], [True, True]]
    """
    pairwise = np.ascontiguousarray(pairwise, np.float64)
    capacity = np.append(pairwise, 0.0)[triangle_links]  # -1, beyond the ghost points, takes the last
    return _cuts(np.ascontiguousarray(unaries, np.float64), capacity, neighbours)


@jit
def _cuts(unaries: FloatArray, residual: FloatArray, neighbours: AnyArray) -> BoolArray:
    count = unaries.shape[1]
    inside = np.zeros(unaries.shape, np.bool_)
    source, sink = np.zeros(count), np.zeros(count)
    reverse = _reverse_sides(neighbours)
    for k in range(len(unaries)):
        for cell in range(count):  # what a cell's energy changes by comes to what is left of it
            left = sink[cell] - source[cell] + unaries[k, cell] - (unaries[k - 1, cell] if k else 0.0)
            source[cell], sink[cell] = max(-left, 0.0), max(left, 0.0)
        while True:
            level = _levels(source, residual, neighbours)
            reached = False
            for cell in range(count):
                inside[k, cell] = level[cell] >= 0
                reached |= level[cell] >= 0 and sink[cell] > _FLOW
            if not reached:
                break
            _block(source, sink, residual, level, neighbours, reverse)
    return inside


@jit
def _reverse_sides(neighbours: AnyArray) -> AnyArray:
    # the neighbour's side (T, 3) that leads back here
    reverse = np.zeros(neighbours.shape, np.int8)
    for cell in range(len(neighbours)):
        for side in range(3):
            beyond = neighbours[cell, side]
            for other in range(3):
                if beyond >= 0 and neighbours[beyond, other] == cell:
                    reverse[cell, side] = other
    return reverse


@jit
def _levels(source: FloatArray, residual: FloatArray, neighbours: AnyArray) -> AnyArray:
    # steps (T,) from the nearest source along capacities that are left; -1 out of reach
    level = np.full(len(source), -1, np.int32)
    queue = np.empty(len(source), np.int32)
    head, tail = 0, 0
    for cell in range(len(source)):
        if source[cell] > _FLOW:
            level[cell] = 0
            queue[tail] = cell
            tail += 1
    while head < tail:
        cell = queue[head]
        head += 1
        for side in range(3):
            beyond = neighbours[cell, side]
            if beyond >= 0 and level[beyond] < 0 and residual[cell, side] > _FLOW:
                level[beyond] = level[cell] + 1
                queue[tail] = beyond
                tail += 1
    return level


@jit
def _block(
    source: FloatArray,
    sink: FloatArray,
    residual: FloatArray,
    level: AnyArray,
    neighbours: AnyArray,
    reverse: AnyArray,
) -> None:
    # pushes flow in place along rising levels until every way is blocked, stepping back at dead ends
    turn = np.zeros(len(source), np.int8)
    path = np.empty(len(source) + 1, np.int32)
    for start in range(len(source)):
        if level[start] != 0:
            continue
        path[0], depth = start, 0
        while source[start] > _FLOW:
            cell = path[depth]
            if sink[cell] > _FLOW:
                _push(source, sink, residual, path[: depth + 1], turn, reverse)
                depth = 0
                continue
            turn[cell] = _next_side(cell, int(turn[cell]), residual, level, neighbours)
            if turn[cell] < 3:
                depth += 1
                path[depth] = neighbours[cell, turn[cell]]
            elif depth > 0:
                depth -= 1
                turn[path[depth]] += 1
            else:
                break


@jit
def _next_side(cell: int, side: int, residual: FloatArray, level: AnyArray, neighbours: AnyArray) -> int:
    # the next side that leads one level up; 3 when there is none
    while side < 3:
        beyond = neighbours[cell, side]
        if beyond >= 0 and residual[cell, side] > _FLOW and level[beyond] == level[cell] + 1:
            break
        side += 1
    return side


@jit
def _push(
    source: FloatArray,
    sink: FloatArray,
    residual: FloatArray,
    path: AnyArray,
    turn: AnyArray,
    reverse: AnyArray,
) -> None:
    # takes what flows along the path out of its capacities, in place
    start, end, steps = path[0], path[-1], len(path) - 1
    flow = min(source[start], sink[end])
    for step in range(steps):
        flow = min(flow, residual[path[step], turn[path[step]]])
    source[start] -= flow
    sink[end] -= flow
    for step in range(steps):
        here, side = path[step], turn[path[step]]
        residual[here, side] -= flow
        residual[path[step + 1], reverse[here, side]] += flow
