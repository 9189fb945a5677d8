"""How many pieces an organ has on a slice, and that it has no holes: labellings that keep to it.

A minimum cut knows nothing of pieces. Where it leaves one too many, or a hole, either the piece is left out
(the hole filled) or a channel is opened along the cheapest way and the cut sought again with the
channel held: the heuristic of DijkstraGC (Vicente, Kolmogorov and Rother 2008). What costs less is taken.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components, dijkstra

from cccd.geometry.arrays import BoolArray, FloatArray, IntArray
from cccd_junctions.decoding import SMALLEST_LOOP_PX
from cccd_junctions.delaunay import DelaunayGraph
from cccd_junctions.energy import HELD, Energy, least_energy

__all__ = ["limit_parts"]

# What every triangle of a channel costs besides, so that channels are short.
_STEP = 1e-3

# More pieces and holes than this are not weighed one by one.
_MOST_CHANGES = 12


@dataclass(frozen=True, eq=False)
class _Labelling:
    """A labelling (T,), its energy, and the energy that holds its channels open."""

    inside: BoolArray
    cost: float
    held: Energy[FloatArray]


def limit_parts(
    graph: DelaunayGraph,
    energy: Energy[FloatArray],
    inside: BoolArray,
    parts: int | None,
) -> BoolArray:
    """Leave out, or join, all holes of a labelling and all pieces but ``parts``, if that is given.

    Parameters
    ----------
    graph : DelaunayGraph
    energy : Energy
        Of which ``inside`` is the least.
    inside : (T,) bool array
    parts : int or None

    Returns
    -------
    (T,) bool array
    """
    if parts is None:
        return inside
    inside = _without_debris(graph, inside, SMALLEST_LOOP_PX)
    current = _Labelling(inside, _cost(graph, energy, inside), energy)
    for _ in range(_MOST_CHANGES):
        region = _regions(graph, current.inside)
        excess = _excess(graph, current.inside, region, parts)
        choices = [one for number in excess for one in _changes(graph, energy, current, region == number)]
        best = min(choices, key=lambda one: one.cost, default=current)
        if best is current:
            break
        current = best
    return current.inside


def _regions(graph: DelaunayGraph, inside: BoolArray) -> IntArray:
    """Find the number (T,) of the connected region of triangles of one label."""
    first, second = graph.link_triangles[
        inside[graph.link_triangles[:, 0]] == inside[graph.link_triangles[:, 1]]
    ].T
    count = len(inside)
    joined = csr_array((np.ones(len(first)), (first, second)), (count, count))
    return connected_components(joined, directed=False)[1].astype(np.int64)


def _excess(graph: DelaunayGraph, inside: BoolArray, region: IntArray, parts: int) -> IntArray:
    """Numbers of the holes, and of all pieces but the largest."""
    area = np.bincount(region, np.where(graph.outer, 0, graph.areas))
    within, beyond = np.unique(region[inside]), np.unique(region[graph.outer])
    pieces = within[np.argsort(-area[within], kind="stable")]
    holes = np.setdiff1d(np.unique(region[~inside]), beyond)
    return np.concatenate([pieces[parts:], holes])


def _without_debris(graph: DelaunayGraph, inside: BoolArray, smallest_px: float) -> BoolArray:
    """Flip regions, but for the outside, that are smaller than wanted."""
    region = _regions(graph, inside)
    small = np.bincount(region, np.where(graph.outer, np.inf, graph.areas)) < smallest_px
    return inside ^ small[region]


def _cost(graph: DelaunayGraph, energy: Energy[FloatArray], inside: BoolArray) -> float:
    nothing = np.zeros(len(inside))
    return float(energy.difference(inside.astype(float), nothing, graph.link_triangles.T))


def _changes(
    graph: DelaunayGraph, energy: Energy[FloatArray], current: _Labelling, part: BoolArray
) -> list[_Labelling]:
    """Flip a piece or a hole (T,), and join it to the others of its label: what can be done about it."""
    flipped = current.inside ^ part
    choices = [_Labelling(flipped, _cost(graph, energy, flipped), current.held)]
    label = bool(current.inside[part][0])
    channel = _channel(graph, current, part, label)
    if channel is not None:
        unary = np.where(channel, -HELD if label else HELD, current.held.unary)
        held = replace(current.held, unary=unary)
        joined = least_energy(graph, held)
        choices.append(_Labelling(joined, _cost(graph, energy, joined), held))
    return choices


def _channel(graph: DelaunayGraph, current: _Labelling, part: BoolArray, label: bool) -> BoolArray | None:
    """Find the triangles (T,) of the cheapest way from a part to another of its label; None without one."""
    unary = current.held.unary * (1 if label else -1)  # what flipping to the label costs
    entering = np.where(current.inside == label, 0, np.maximum(unary, 0)) + _STEP
    entering = np.where(graph.outer, HELD if label else _STEP, entering)
    first, second = graph.link_triangles.T
    count = len(part)
    ways = csr_array(
        (
            np.concatenate([entering[second], entering[first]]),
            (np.concatenate([first, second]), np.concatenate([second, first])),
        ),
        (count, count),
    )
    far, before, _ = dijkstra(ways, indices=np.flatnonzero(part), min_only=True, return_predecessors=True)
    others = np.flatnonzero((current.inside == label) & ~part)
    if not len(others):
        return None
    at = int(others[far[others].argmin()])
    if far[at] >= HELD:
        return None
    channel = np.zeros(count, bool)
    while at >= 0:
        channel[at] = True
        at = int(before[at])
    return channel
