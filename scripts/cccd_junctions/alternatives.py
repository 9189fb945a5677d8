"""Other labellings of a slice than the least cut, and what can be said of each as a whole.

The energy is a sum over triangles and links: it cannot say that an organ is one piece, that its outline is
smooth, or that one of two parallel lines is the border all the way round. Alternatives differ from the least
cut by one zone each, which cuts with shifted logits change as well; they are described by sums over what they
change and by the shape of their outlines, and `cccd_junctions.reranking` chooses among them.
"""

from __future__ import annotations

import numpy as np

from cccd.geometry._jit import jit
from cccd.geometry.arrays import BoolArray, FloatArray, IntArray, connected_parts
from cccd_junctions.decoding import SMALLEST_LOOP_PX, border_loops
from cccd_junctions.delaunay import REGION_GAPS_PX, DelaunayGraph
from cccd_junctions.energy import Energy, EnergyWeights, Logits, least_energies

#: Nats by which all logits are shifted, to either side.
SHIFTS = (1.0, 3.0, 9.0)
#: Smaller zones are not weighed, and of the others at most so many, those that cost least.
SMALLEST_PX, MOST_ZONES = 4.0, 24
#: How many of the largest regions have their costs described.
_MOST_COUNTED = 100
#: Logits count up to these.
_MOST_LOGIT = 8.0
#: Pixels along an outline to either side of which its direction is compared, and the turn of a sharp corner.
_ARM, _SHARP = 5, 1.3


def alternatives(
    graph: DelaunayGraph, energy: Energy[FloatArray], weights: EnergyWeights[FloatArray], first: BoolArray
) -> BoolArray:
    """List labellings that the least cut nearly was.

    Parameters
    ----------
    graph : DelaunayGraph
    energy : Energy
        Of the (T,) triangles and (L,) links.
    weights : EnergyWeights
        What a nat of a triangle's logit counts in it.
    first : (T,) bool array
        The labelling that they differ from: the least cut, or what is left of it. Not empty.

    Returns
    -------
    (K, T) bool array
        ``first``, and it with one connected zone changed each, by rising energy; none is empty. A zone is
        what the cut changes somewhere when all logits are shifted by `SHIFTS`.
    """
    shifts = sorted([*SHIFTS, *(-nats for nats in SHIFTS)])
    cuts = least_energies(graph, [energy.unary - nats * weights.unary for nats in shifts], energy.pairwise)
    zones = _zones(graph, cuts ^ first)
    labels = zones ^ first
    labels = labels[np.argsort(_costs(graph, energy, labels), kind="stable")[:MOST_ZONES]]
    return np.concatenate([first[None], labels[labels.any(axis=1)]])


def _zones(graph: DelaunayGraph, changed: BoolArray) -> BoolArray:
    """Find the largest connected zones (Z, T) of what cuts (K, T) change, but for tiny ones; each once."""
    first, second = graph.link_triangles.T
    cuts, count = changed.shape
    cut, link = np.nonzero(changed[:, first] & changed[:, second])
    number = connected_parts(cut * count + first[link], cut * count + second[link], cuts * count)
    at = np.flatnonzero(changed)
    _, zone = np.unique(number[at], return_inverse=True)
    triangle = at % count
    area = np.bincount(zone, _inner_areas(graph)[triangle])
    counted = np.argsort(-area, kind="stable")[:_MOST_COUNTED]
    row = np.full(len(area), -1)
    row[counted] = np.where(area[counted] >= SMALLEST_PX, np.arange(len(counted)), -1)
    zones = np.zeros((row.max(initial=-1) + 1, count), bool)
    kept = row[zone] >= 0
    zones[row[zone[kept]], triangle[kept]] = True
    bits = np.packbits(zones, axis=1)
    _, once = np.unique(bits.view(np.dtype((np.void, bits.shape[1]))), return_index=True)
    return zones[np.sort(once)]


def _inner_areas(graph: DelaunayGraph) -> FloatArray:
    return np.where(graph.outer, 0, graph.areas)


def _costs(graph: DelaunayGraph, energy: Energy[FloatArray], labels: BoolArray) -> FloatArray:
    """Energies (K,) of labellings (K, T)."""
    first, second = graph.link_triangles.T
    return labels @ energy.unary + (labels[:, first] != labels[:, second]) @ energy.pairwise


_LINK_SUMS = ("length", "gap", "long", "longer", "energy", "logit", "unseen")
_TRIANGLE_SUMS = ("area", "width", "logit", "odd", "near", "wide", "wider")
_SHAPE = ("parts", "holes", "area", "beside", "turn", "sharp", "bend", "seen")

#: What `describe` gives, in order: sums along the whole border, along what it loses and gains, over triangles
#: that join the inside and leave it, the outlines' shape, and what changes of border and shape.
FEATURES: tuple[str, ...] = (
    *(f"border {name}" for name in _LINK_SUMS),
    *(f"{change} {name}" for change in ("lost", "gained") for name in _LINK_SUMS),
    *(f"{change} mean {name}" for change in ("lost", "gained") for name in ("gap", "logit", "unseen")),
    *(f"{change} {name}" for change in ("joined", "left") for name in _TRIANGLE_SUMS),
    *(f"{change} mean {name}" for change in ("joined", "left") for name in _TRIANGLE_SUMS[2:]),
    *_SHAPE,
    *(f"{name} more" for name in _SHAPE),
    "cost",
    "thickness",
    "size",
    "first",
)


def describe(
    graph: DelaunayGraph, logits: Logits, energy: Energy[FloatArray], labels: BoolArray
) -> FloatArray:
    """Describe labellings as a whole, beside the first of them.

    Parameters
    ----------
    graph : DelaunayGraph
    logits : tuple of (T,) and (L,) arrays
    energy : Energy
        Of these logits.
    labels : (K, T) bool array
        As from `alternatives`.

    Returns
    -------
    (K, F) float64
        `FEATURES`: lengths and areas in pixels, logits in nats, turns in radians, sums and differences by
        their inverse hyperbolic sine.
    """
    first, second = graph.link_triangles.T
    border = labels[:, first] != labels[:, second]
    lost, gained = border[0] & ~border, border & ~border[0]
    joined, left = labels & ~labels[0], labels[0] & ~labels
    by_link, by_triangle = _link_terms(graph, logits, energy), _triangle_terms(graph, logits)
    along, less, more = (part @ by_link for part in (border, lost, gained))
    into, out = (part @ by_triangle for part in (joined, left))
    shape = _shapes(graph, labels, border)
    costs = _costs(graph, energy, labels)
    changed = into[:, 0] + out[:, 0]
    thickness = changed / np.maximum(less[:, 0] + more[:, 0], 1)
    size = np.full(len(labels), np.sqrt(max(shape[0, 2], 1.0)))
    return np.column_stack(
        [
            np.arcsinh(np.column_stack([along, less, more])),
            *(part[:, [1, 5, 6]] / np.maximum(part[:, :1], 1) for part in (less, more)),
            np.arcsinh(np.column_stack([into, out])),
            *(part[:, 2:] / np.maximum(part[:, :1], 1) for part in (into, out)),
            np.arcsinh(shape),
            np.arcsinh(shape - shape[0]),
            np.arcsinh(costs - costs[0]),
            np.arcsinh(thickness),
            np.log(size),
            np.arange(len(labels)) == 0,
        ]
    )


def pieces(features: FloatArray) -> tuple[IntArray, IntArray]:
    """Parts and holes (K,) of labellings, from their features (K, F)."""
    parts, holes = (np.rint(np.sinh(features[:, FEATURES.index(name)])) for name in ("parts", "holes"))
    return parts.astype(np.int64), holes.astype(np.int64)


def _link_terms(graph: DelaunayGraph, logits: Logits, energy: Energy[FloatArray]) -> FloatArray:
    """List what is summed along borders (L, 7): `_LINK_SUMS`."""
    length = graph.link_lengths
    seen = graph.observed[graph.links].all(axis=1)
    gap = np.where(length > REGION_GAPS_PX[0], length - 1, 0)
    longer = (np.where(length > wall, length, 0) for wall in REGION_GAPS_PX[1:3])
    logit = np.clip(logits[1], -_MOST_LOGIT, _MOST_LOGIT) * length
    return np.column_stack([length, gap, *longer, energy.pairwise, logit, length * ~seen])


def _triangle_terms(graph: DelaunayGraph, logits: Logits) -> FloatArray:
    """List what is summed over triangles (T, 7): `_TRIANGLE_SUMS`."""
    area = _inner_areas(graph)
    logit = np.clip(logits[0], -_MOST_LOGIT, _MOST_LOGIT)
    odd, within = graph.depths[:, 0] % 2, graph.depths[:, :3] > 0
    return area[:, None] * np.column_stack(
        [np.ones(len(area)), 1 / np.sqrt(np.maximum(area, 0.5)), logit, odd, within]
    )


def _shapes(graph: DelaunayGraph, labels: BoolArray, border: BoolArray) -> FloatArray:
    """Shape (K, 8) of what labellings enclose: `_SHAPE`."""
    fragment = graph.fragments
    clear = graph.observed & (np.bincount(fragment)[fragment] >= SMALLEST_LOOP_PX)
    shapes = np.zeros((len(labels), len(_SHAPE)))
    for shape, inside, links in zip(shapes, labels, border, strict=True):
        loops = border_loops(graph, inside)
        sizes = np.array([len(loop) for loop in loops], np.int64)
        shape[:-1] = _shape(np.concatenate(loops), sizes, SMALLEST_LOOP_PX)
        on_border = np.zeros(len(clear), bool)
        on_border[graph.links[links]] = True
        shape[-1] = np.count_nonzero(on_border & clear) / max(np.count_nonzero(clear), 1)
    return shapes


@jit
def _shape(points: IntArray, sizes: IntArray, smallest: float) -> FloatArray:
    """Parts, holes, area, the share beside the largest loop, and turns of outlines (7,)."""
    shape = np.zeros(7)
    start, largest = 0, 0.0
    for size in sizes:
        area = 0.0
        for n in range(size):
            (a, b), (c, d) = points[start + n], points[start + (n + 1) % size]
            area += (a * d - c * b) / 2
        if abs(area) >= smallest:
            shape[0 if area > 0 else 1] += 1
            shape[2] += area
            largest = max(largest, abs(area))
            if size > 2 * _ARM:
                _add_turns(points[start : start + size], shape)
        start += size
    shape[3] = 1 - largest / max(shape[2], 1.0) if largest > 0 else 0.0
    return shape


@jit
def _add_turns(loop: IntArray, shape: FloatArray) -> None:
    """Add a loop's turns between arms of some pixels: in all, where sharp, and squared."""
    size = len(loop)
    for n in range(size):
        back_i = loop[n, 0] - loop[n - _ARM, 0]
        back_j = loop[n, 1] - loop[n - _ARM, 1]
        on_i = loop[(n + _ARM) % size, 0] - loop[n, 0]
        on_j = loop[(n + _ARM) % size, 1] - loop[n, 1]
        turn = abs(np.arctan2(back_i * on_j - back_j * on_i, back_i * on_i + back_j * on_j))
        shape[4] += turn / _ARM
        shape[5] += turn > _SHARP
        shape[6] += turn**2 / _ARM
