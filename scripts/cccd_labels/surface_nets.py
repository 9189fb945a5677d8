"""Surfaces between the regions of a grid of labels: surface nets whose regions are all manifold.

One quadrilateral crosses each edge between nodes of different labels (Gibson 1998), so what two regions
share is one surface from the start. Its corners stand in the cells around the edge. A cell of two labels has
a vertex for each sheet of surface in it (Nielson 2004), parted on its faces by the asymptotic decider
(Nielson and Hamann 1991). One of more labels has one vertex; a region's surface is manifold there where its
nodes are well-composed (Latecki 1997), so nodes by which two parts of a region would touch along an edge or
in a corner only go over to a neighbour first.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import product
from typing import NamedTuple

import numpy as np

from cccd.geometry.arrays import BoolArray, FloatArray, IntArray, LabelArray, connected_parts
from cccd.geometry.mesh import Mesh
from cccd_labels.conforming import ConformingSurface

#: Takes nodes (P, 3) and labels (P,); what it returns (P,) is smaller for labels that suit the nodes better.
NodeCost = Callable[[IntArray, LabelArray], FloatArray]
#: Takes the nodes (E, 3) at both ends of edges and their labels (E,); returns the share (E,) of each edge at
#: which the region of the first label ends.
Cut = Callable[[IntArray, IntArray, LabelArray, LabelArray], FloatArray]

#: Rounds in which nodes go over to a neighbour's label; the last ones change few.
MOST_ROUNDS = 500
#: Quadrilaterals are split so many at once: each takes some 600 bytes meanwhile.
SLAB_QUADS = 100_000
#: What it costs more to take a node from a region that is one node thin there: it would have a hole.
KEPT = 2.0

_CORNERS = np.array(list(product((0, 1), repeat=3)))  # corner 4 x + 2 y + z of a cell
#: The four corners of each of a cell's faces, around it, and the ends of its diagonals.
_FACES = np.array([(0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4), (1, 3, 7, 5)])
_DIAGONALS = np.array([(0, 7), (1, 6), (2, 5), (3, 4)])
#: Ends of a cell's edges, four along each axis: from its first corner, from the next along the third axis,
#: along the second, and along both; the second is the one after an axis, the third the one after that.
_EDGES = np.array(
    [
        (start, start + step)
        for step, second, third in ((4, 2, 1), (2, 1, 4), (1, 4, 2))
        for start in (0, third, second, second + third)
    ]
)
#: Edges between neighbouring corners of a cell's faces.
_SIDES = np.array(
    [[_EDGES.tolist().index(sorted(side)) for side in zip(f, np.roll(f, -1), strict=True)] for f in _FACES]
)

#: Pairs of a face's sides: around each of its corners, and opposite ones.
_LINKS = np.array([(3, 0), (0, 1), (1, 2), (2, 3), (0, 2), (1, 3)])


def _mixed(labels: LabelArray) -> BoolArray:
    """Whether the corners of the cells (A - 1, B - 1, C - 1) of a grid of labels (A, B, C) differ."""
    mixed = np.zeros(tuple(size - 1 for size in labels.shape), np.bool_)
    for corner in _CORNERS[1:]:
        mixed |= labels[_nodes_at(corner, mixed)] != labels[:-1, :-1, :-1]
    return mixed


def _thin(mixed: BoolArray) -> BoolArray:
    """Whether nodes (A, B, C) are corners of mixed cells alone: their region is one node thin there."""
    thin = np.ones(tuple(size + 1 for size in mixed.shape), np.bool_)
    for corner in _CORNERS:
        thin[_nodes_at(corner, mixed)] &= mixed
    return thin


def _nodes_at(corner: IntArray, cells: BoolArray) -> tuple[slice, ...]:
    """Nodes that are a given corner (3,) of each cell."""
    return tuple(slice(start, start + size) for start, size in zip(corner, cells.shape, strict=True))


def _ambiguous(corner_labels: LabelArray) -> BoolArray:
    """Whether cells (C, 8) may hold several sheets: a label's corners touch along an edge or in a corner only."""
    # Of a face's four corners, two opposite ones are alike and both others differ from them; or, in a cell,
    # two opposite corners are alike and no other, or all but two opposite corners are.
    found = np.zeros(len(corner_labels), np.bool_)
    for face in _FACES:
        p, q, r, s = (corner_labels[:, corner] for corner in face)
        found |= ((p == r) & (q != p) & (s != p)) | ((q == s) & (p != q) & (r != q))
    for one, other in _DIAGONALS:
        alike = corner_labels == corner_labels[:, one, None]
        between = next(corner for corner in range(8) if corner not in (one, other))
        around = corner_labels == corner_labels[:, between, None]
        found |= alike[:, other] & (alike.sum(axis=1) == 2)
        found |= ~around[:, one] & ~around[:, other] & (around.sum(axis=1) == 6)
    return found


def well_composed(labels: LabelArray, cost: NodeCost, cut: Cut) -> tuple[LabelArray, int]:
    """Let nodes go over to a neighbour's label until no region touches itself in a vertex or edge of its net.

    Parameters
    ----------
    labels : (A, B, C) int
        Those on the grid's faces stay.
    cost : callable
        What a node would pay for a label; the cheapest node goes.
    cut : callable
        As for `surface_nets`.

    Returns
    -------
    labels : (A, B, C) int
    left : int
        Places that are still pinched after `MOST_ROUNDS`.

    Notes
    -----
    At first no node changes twice. Where that leaves something, nodes go over to larger labels alone, as
    often as it takes: one of those that pinch always can.
    """
    labels, fixed = labels.copy(), np.ones(labels.shape, np.bool_)
    fixed[1:-1, 1:-1, 1:-1] = False
    mixed = _mixed(labels)
    cells, thin = np.argwhere(mixed), _thin(mixed)
    for rising in (False, True):
        changed = fixed.copy()
        for _ in range(MOST_ROUNDS):
            cells = cells[_ambiguous(_corner_labels(labels, cells))]
            pinched = _sheets(labels, cells, cut).pinched
            nodes, new = _cheapest(labels, cells[pinched], changed, thin, cost, rising)
            if len(nodes) == 0:
                break
            labels[tuple(nodes.T)] = new
            if not rising:
                changed[tuple(nodes.T)] = True
            cells = _once(np.concatenate([cells, (nodes[:, None] - _CORNERS).reshape(-1, 3)]), labels.shape)
    return labels, len(pinched)


def _once(cells: IntArray, shape: tuple[int, ...]) -> IntArray:
    """Sort cells (C, 3) of a grid, each once."""
    # as numbers: rows would sort twenty times as slowly, and `unique` hashes
    keys = np.sort(np.ravel_multi_index(tuple(cells.T), shape))
    return np.column_stack(np.unravel_index(keys[np.diff(keys, prepend=-1) > 0], shape))


def _corner_labels(labels: LabelArray, cells: IntArray) -> LabelArray:
    """Labels (C, 8) of the corners of cells (C, 3)."""
    first = np.ravel_multi_index(tuple(cells.T), labels.shape)
    steps = np.asarray(np.ravel_multi_index(tuple(_CORNERS.T), labels.shape))
    return np.stack([labels.ravel()[first + step] for step in steps.tolist()], axis=1)


def _cheapest(
    labels: LabelArray, cells: IntArray, changed: BoolArray, thin: BoolArray, cost: NodeCost, rising: bool
) -> tuple[IntArray, LabelArray]:
    """Of each pinched cell (K, 3) the node and the label, of those there, that together cost least."""
    here = _corner_labels(labels, cells)
    node = np.repeat(cells[:, None] + _CORNERS, 8, axis=1).reshape(-1, 3)
    have, want = np.repeat(here, 8, axis=1).ravel(), np.tile(here, (1, 8)).ravel()
    price = np.full(len(node), np.inf)
    may = (want > have if rising else want != have) & ~changed[tuple(node.T)]
    price[may] = cost(node[may], want[may]) - cost(node[may], have[may]) + KEPT * thin[tuple(node[may].T)]
    price = price.reshape(-1, 64)
    best = price.argmin(axis=1) + np.arange(len(price)) * 64
    best = best[np.isfinite(price.ravel()[best])]
    node, want = node[best], want[best]
    once = np.unique(np.ravel_multi_index(tuple(node.T), changed.shape), return_index=True)[1]
    return node[once], want[once]


def surface_nets(labels: LabelArray, cut: Cut) -> tuple[ConformingSurface, FloatArray, int]:
    """Mesh the surfaces between the regions of a grid, in nodes.

    Parameters
    ----------
    labels : (A, B, C) int
        0 on the grid's faces.
    cut : callable
        Where regions end along the edges of the grid.

    Returns
    -------
    ConformingSurface
        Every vertex is the mean of the cuts of its cell's edges, or of those of one sheet of surface in the
        cell. Normals leave the larger label. Triangles that are not halves of a quadrilateral come last.
    (V, 3) float64
        Means lie within what is bent: vertices nearer to it, moved as far as the middles of their
        quadrilaterals are off the cuts.
    int
        The number of quadrilaterals.
    """
    cells = np.argwhere(_mixed(labels))
    shape = tuple(size - 1 for size in labels.shape)
    keys = np.ravel_multi_index(tuple(cells.T), shape)  # ascending
    several = np.flatnonzero(_ambiguous(_corner_labels(labels, cells)))
    sheets = _sheets(labels, cells[several], cut)
    row = np.full(len(cells), -1)
    row[several] = np.arange(len(several))
    quads: list[IntArray] = []
    cuts: list[FloatArray] = []
    regions: list[IntArray] = []
    for axis in range(3):
        nodes = np.argwhere(np.diff(labels, axis=axis) != 0)
        ends = nodes + np.eye(3, dtype=np.int64)[axis]
        low, high = labels[tuple(nodes.T)], labels[tuple(ends.T)]
        point = nodes.astype(float)
        point[:, axis] += cut(nodes, ends, low, high)
        second, third = np.eye(3, dtype=np.int64)[[(axis + 1) % 3, (axis + 2) % 3]]
        around = [(nodes - second - third, 3), (nodes - third, 1), (nodes, 0), (nodes - second, 2)]
        quad = np.full((len(nodes), 8), -1)
        for corner, (cell, edge) in enumerate(around):
            at = np.asarray(np.searchsorted(keys, np.ravel_multi_index(tuple(cell.T), shape)), np.int64)
            parted = np.flatnonzero(row[at] >= 0)
            here, edge = row[at[parted]], 4 * axis + edge
            other = sheets.number[here, edge] > 0
            at[parted[other]] = len(cells) + sheets.number[here[other], edge] - 1
            quad[:, 2 * corner] = at
            if corner % 2:  # between this cell and the one before it, and the next one
                for side in (0, 1):
                    quad[parted, (2 * corner - 1 + 2 * side) % 8] = sheets.middle[here, edge, side]
        middle = quad[:, 1::2]
        middle[middle >= 0] += len(cells) + sheets.count
        cuts.append(point)
        quads.append(np.where((low > high)[:, None], quad, quad[:, ::-1]))
        regions.append(np.column_stack([np.maximum(low, high), np.minimum(low, high)]).astype(np.int64))
    return _meshed(np.concatenate(quads), np.concatenate(regions), np.concatenate(cuts))


def _meshed(rims: IntArray, regions: IntArray, cuts: FloatArray) -> tuple[ConformingSurface, FloatArray, int]:
    """Split polygons with up to eight vertices (P, 8), -1 between them; the cut is the middle of large ones."""
    large = (rims >= 0).sum(axis=1) > 4
    quad = rims[~large][rims[~large] >= 0].reshape(-1, 4)
    middle = rims.max() + 1 + np.arange(np.count_nonzero(large))
    rim = rims[large]
    rim = np.where(rim >= 0, rim, np.roll(rim, -1, axis=1))
    fan = np.stack([rim, np.roll(rim, -1, axis=1), np.broadcast_to(middle[:, None], rim.shape)], axis=2)
    used = fan[..., 0] != fan[..., 1]
    at = np.column_stack([*np.nonzero(rims >= 0), rims[rims >= 0]])  # polygon, place, vertex
    at = np.concatenate([at[:, [0, 2]], np.column_stack([np.flatnonzero(large), middle])])
    vertices = _mean_at(at, cuts)
    total = np.bincount(at[:, 0])
    middles = np.column_stack([np.bincount(at[:, 0], along) / total for along in vertices[at[:, 1]].T])
    triangles = np.concatenate([split_quads(vertices, quad), fan[used]])
    beside = np.concatenate([np.repeat(regions[~large], 2, axis=0), np.repeat(regions[large], used.sum(axis=1), axis=0)])
    nearer = vertices + _mean_at(at, cuts - middles)
    return ConformingSurface(vertices, triangles, beside), nearer, len(quad)


def _mean_at(at: IntArray, values: FloatArray) -> FloatArray:
    """Mean (V, 3) at each vertex of the values (P, 3) of the polygons there: pairs (N, 2) of both."""
    count = np.bincount(at[:, 1])
    return np.column_stack([np.bincount(at[:, 1], along) / count for along in values[at[:, 0]].T])


class _Sheets(NamedTuple):
    """The sheets of surface in cells (C,)."""

    number: IntArray  # (C, 12) of the sheet that cuts each edge: 0 for the first of the cell, others from 1 on
    count: int  # of the others
    middle: IntArray  # (C, 12, 2) of the vertex between cells, across the faces around each edge; or -1
    pinched: IntArray  # (P,) cells in which a region touches itself in a vertex


def _sheets(labels: LabelArray, cells: IntArray, cut: Cut) -> _Sheets:
    """Part the sheets of surface in ambiguous cells (C, 3)."""
    here = _corner_labels(labels, cells)
    ends = here[:, _EDGES]
    cuts = ends[..., 0] != ends[..., 1]
    cut_sides, around = cuts[:, _SIDES], here[:, _FACES]
    four = cut_sides.all(axis=2)
    alike = (around[..., :2] == around[..., 2:]) & four[..., None]  # the first and third, second and fourth
    cell, face = np.nonzero(alike.any(axis=2))
    first, same = _joined_across(labels, cells[cell], face, cut)
    alike[cell, face] = np.column_stack([first, ~first])[same]
    both = cut_sides[..., _LINKS[:, 0]] & cut_sides[..., _LINKS[:, 1]]
    both[..., :4] &= ~alike[..., [0, 1, 0, 1]]
    both[..., 4:] &= ~four[..., None]
    at, on, link = np.nonzero(both)
    one, other = 12 * at + _SIDES[on, _LINKS[link, 0]], 12 * at + _SIDES[on, _LINKS[link, 1]]
    sheets = connected_parts(one, other, cuts.size).reshape(cuts.shape)
    # two strips between the same two vertices would share an edge
    sides = np.where(first[same, None], _SIDES[face], np.roll(_SIDES[face], 1, axis=1))
    twice = np.bincount(same, sheets[cell, sides[:, 0]] == sheets[cell, sides[:, 2]], len(first)) == 2
    middle = np.full((*cuts.shape, 2), -1)
    for side in range(4):
        edge = sides[:, side]
        which = (np.cumsum(twice) - 1)[same] * 2 + side // 2
        middle[cell, edge, (face // 2 - edge // 4 - 1) % 3] = np.where(twice[same], which, -1)
    pinched = _pinched(ends, cuts, sheets, one, other)
    number = np.zeros_like(sheets)
    others = cuts & (sheets != sheets[np.arange(len(sheets)), cuts.argmax(axis=1), None])
    found, number[others] = np.unique(sheets[others], return_inverse=True)
    number[others] += 1
    return _Sheets(number, len(found), middle, pinched)


def _pinched(ends: LabelArray, cuts: BoolArray, sheets: IntArray, one: IntArray, other: IntArray) -> IntArray:
    """Cells in which a region has two rims in one sheet; edges ``one`` and ``other`` (N,) meet in a face."""
    flat = ends.reshape(-1, 2)
    pairs = [
        np.column_stack([2 * one + m, 2 * other + n])[flat[one, m] == flat[other, n]]
        for m in (0, 1)
        for n in (0, 1)
    ]
    rims = connected_parts(*np.concatenate(pairs).T, 2 * cuts.size).reshape(-1, 2)
    edge = np.flatnonzero(cuts)
    key = (sheets.ravel()[edge, None] * (int(flat.max(initial=0)) + 1) + flat[edge]).ravel()
    _, begin, which = np.unique(key, return_index=True, return_inverse=True)
    rim = rims[edge].ravel()
    return np.unique(np.repeat(edge // 12, 2)[rim != rim[begin[which]]])


def _joined_across(
    labels: LabelArray, cells: IntArray, face: IntArray, cut: Cut
) -> tuple[BoolArray, IntArray]:
    """Whether the first corner's label is joined across faces with one label at opposite corners.

    Each face of cells (K, 3) is two cells'; decided once. Of two labels on both diagonals the value decides
    where the distance between them, linear along the face's edges, has its saddle; the outside never is.
    Returns that (F,), and which of these each (K,) is.
    """
    corners = cells[:, None] + _CORNERS[_FACES[face]]
    keys = np.ravel_multi_index(tuple(corners[:, 0].T), labels.shape) * 3 + face // 2
    _, once, same = np.unique(keys, return_index=True, return_inverse=True)
    corners = corners[once].transpose(1, 0, 2)
    at = [labels[tuple(nodes.T)] for nodes in corners]
    first, last = (cut(corners[i], corners[j], at[i], at[j]) for i, j in ((0, 1), (3, 2)))
    joined = np.where((first == last) | (at[0] == 0) | (at[1] == 0), at[0] > at[1], first > last)
    return np.where(at[1] != at[3], True, np.where(at[0] != at[2], False, joined)), same


def split_quads(vertices: FloatArray, quads: IntArray) -> IntArray:
    """Triangles (2 Q, 3) of quadrilaterals (Q, 4), split along their shorter diagonals."""
    a, b, c, d = (vertices[quads[:, corner]] for corner in range(4))
    return _halves(quads, np.linalg.norm(a - c, axis=1) <= np.linalg.norm(b - d, axis=1))


def split_again(surface: ConformingSurface, quads: int) -> ConformingSurface:
    """Split the quadrilaterals of `surface_nets` along the diagonals at which their triangles turn less.

    Smoothing straightens lines between walls: where three corners lie on one, the diagonal that was the
    shorter one may come to lie outside of the quadrilateral, and its triangles fold.

    Parameters
    ----------
    surface : ConformingSurface
        With the triangles of `surface_nets`, in their order.
    quads : int
        The number of quadrilaterals, as it returned it.
    """
    pairs = surface.triangles[: 2 * quads].reshape(-1, 2, 3)
    at_first = pairs[:, 0, 2] == pairs[:, 1, 1]  # split from the first corner, as in `_halves`
    rims = np.where(
        at_first[:, None],
        np.column_stack([pairs[:, 0], pairs[:, 1, 2]]),
        np.column_stack([pairs[:, 0, 0], pairs[:, 1]]),
    )
    slabs = np.array_split(rims, quads // SLAB_QUADS + 1)
    turned = [_turned_less(surface.vertices, slab) for slab in slabs]
    return replace(surface, triangles=np.concatenate([*turned, surface.triangles[2 * quads :]]))


def _turned_less(vertices: FloatArray, quads: IntArray) -> IntArray:
    """Triangles (2 Q, 3) of quadrilaterals (Q, 4), split along the diagonals at which they turn less."""
    cosines: list[FloatArray] = []
    for choice in (True, False):
        normals = Mesh(vertices, _halves(quads, np.full(len(quads), choice))).unit_normals.reshape(-1, 2, 3)
        cosines.append((normals[:, 0] * normals[:, 1]).sum(axis=1))
    return _halves(quads, cosines[0] >= cosines[1])


def _halves(quads: IntArray, at_first: BoolArray) -> IntArray:
    """Triangles (2 Q, 3) of quadrilaterals, split from the first corner or from the second."""
    first = np.where(at_first[:, None], quads[:, [0, 1, 2]], quads[:, [0, 1, 3]])
    second = np.where(at_first[:, None], quads[:, [0, 2, 3]], quads[:, [1, 2, 3]])
    return np.stack([first, second], axis=1).reshape(-1, 3)
