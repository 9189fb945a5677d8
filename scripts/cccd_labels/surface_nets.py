"""Surfaces between the regions of a grid of labels: surface nets whose regions are all manifold.

One quadrilateral crosses each edge between nodes of different labels (Gibson 1998), so what two regions
share is one surface from the start. Its corners stand in the cells around the edge: in each cell a vertex for
each sheet of surface (Nielson 2004). A label at opposite corners alone of a face is joined there, so what is
thin stays whole; of two such labels one is (asymptotic decider, Nielson and Hamann 1991). The few nodes by
which a region would still touch itself in a vertex go over to a neighbour first.
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

#: What it costs more to take a node from a region that is one node thin there: it would have a hole.
KEPT = 2.0
#: Quadrilaterals are split so many at once: each takes some 600 bytes meanwhile.
SLAB_QUADS = 100_000

_CORNERS = np.array(list(product((0, 1), repeat=3)))  # corner 4 x + 2 y + z of a cell
#: The four corners of each of a cell's faces, around it.
_FACES = np.array([(0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4), (1, 3, 7, 5)])
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
        there = tuple(slice(start, start + size) for start, size in zip(corner, mixed.shape, strict=True))
        mixed |= labels[there] != labels[:-1, :-1, :-1]
    return mixed


def _ambiguous(corner_labels: LabelArray) -> BoolArray:
    """Whether cells (C, 8) may hold several sheets: all sides of a face are cut, or opposite corners off."""
    cuts = corner_labels[:, _EDGES[:, 0]] != corner_labels[:, _EDGES[:, 1]]
    off = np.stack([cuts[:, np.isin(_EDGES, corner).any(axis=1)].all(axis=1) for corner in range(8)], axis=1)
    return cuts[:, _SIDES].all(axis=2).any(axis=1) | (off & off[:, ::-1]).any(axis=1)


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
        Places that are still pinched.
    """
    labels, mixed = labels.copy(), _mixed(labels)
    cells = np.argwhere(mixed)
    # at first no node changes twice; what that leaves goes over to larger labels alone: one always can
    for rising in (False, True):
        changed = np.pad(np.zeros([size - 2 for size in labels.shape], np.bool_), 1, constant_values=True)
        while True:
            cells = cells[_ambiguous(_corner_labels(labels, cells))]
            cells = cells[_sheets(labels, cells, cut).pinched]
            nodes, new = _cheapest(labels, cells, mixed, changed, cost, rising)
            if len(nodes) == 0:
                break
            labels[tuple(nodes.T)] = new
            if not rising:
                changed[tuple(nodes.T)] = True
            cells = np.unique(np.concatenate([cells, (nodes[:, None] - _CORNERS).reshape(-1, 3)]), axis=0)
    return labels, len(cells)


def _corner_labels(labels: LabelArray, cells: IntArray) -> LabelArray:
    """Labels (C, 8) of the corners of cells (C, 3)."""
    first = np.ravel_multi_index(tuple(cells.T), labels.shape)
    steps = np.asarray(np.ravel_multi_index(tuple(_CORNERS.T), labels.shape))
    return np.stack([labels.ravel()[first + step] for step in steps.tolist()], axis=1)


def _cheapest(
    labels: LabelArray, cells: IntArray, mixed: BoolArray, changed: BoolArray, cost: NodeCost, rising: bool
) -> tuple[IntArray, LabelArray]:
    """Of each pinched cell (K, 3) the node and the label, of those there, that together cost least."""
    here = _corner_labels(labels, cells)
    node = np.repeat(cells[:, None] + _CORNERS, 8, axis=1).reshape(-1, 3)
    have, want = np.repeat(here, 8, axis=1).ravel(), np.tile(here, (1, 8)).ravel()
    price = np.full(len(node), np.inf)
    may = (want > have if rising else want != have) & ~changed[tuple(node.T)]
    thin = mixed[tuple((node[may, None] - _CORNERS).transpose(2, 0, 1))].all(axis=1)  # at first
    price[may] = cost(node[may], want[may]) - cost(node[may], have[may]) + KEPT * thin
    best = price.reshape(-1, 64).argmin(axis=1) + np.arange(len(cells)) * 64
    best = best[np.isfinite(price[best])]
    node, want = node[best], want[best]
    once = np.unique(np.ravel_multi_index(tuple(node.T), changed.shape), return_index=True)[1]
    return node[once], want[once]


def surface_nets(labels: LabelArray, cut: Cut) -> tuple[ConformingSurface, FloatArray, IntArray]:
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
    (Q, 4) int64
        The quadrilaterals.
    """
    return _meshed(*_quads_across(labels, cut))


def _quads_across(labels: LabelArray, cut: Cut) -> tuple[IntArray, IntArray, IntArray, FloatArray]:
    """Find what `_meshed` takes: a quadrilateral across each edge of the grid that leaves a label."""
    cells = np.argwhere(_mixed(labels))
    shape = tuple(size - 1 for size in labels.shape)
    keys = np.ravel_multi_index(tuple(cells.T), shape)  # ascending
    several = np.flatnonzero(_ambiguous(_corner_labels(labels, cells)))
    sheets = _sheets(labels, cells[several], cut)
    vertices = np.where(sheets.other < 0, several[:, None], len(cells) + sheets.other)
    row = np.full(len(cells), -1)
    row[several] = np.arange(len(several))
    quads, across, cuts, regions = list[IntArray](), list[IntArray](), list[FloatArray](), list[IntArray]()
    for axis in range(3):
        nodes = np.argwhere(np.diff(labels, axis=axis) != 0)
        ends = nodes + np.eye(3, dtype=np.int64)[axis]
        low, high = labels[tuple(nodes.T)], labels[tuple(ends.T)]
        point = nodes.astype(float)
        point[:, axis] += cut(nodes, ends, low, high)
        second, third = np.eye(3, dtype=np.int64)[[(axis + 1) % 3, (axis + 2) % 3]]
        around = [(nodes - second - third, 3), (nodes - third, 1), (nodes, 0), (nodes - second, 2)]
        quad, middle = np.empty((len(nodes), 4), np.int64), np.full((len(nodes), 4), -1)
        for corner, (cell, edge) in enumerate(around):
            at = np.asarray(np.searchsorted(keys, np.ravel_multi_index(tuple(cell.T), shape)), np.int64)
            parted = np.flatnonzero(row[at] >= 0)
            quad[:, corner], here = at, row[at[parted]]
            quad[parted, corner] = vertices[here, 4 * axis + edge]
            if corner % 2:  # from the corner before, and to the next
                middle[parted, corner - 1 : corner + 1] = sheets.middle[here, 4 * axis + edge]
        falls = (low > high)[:, None]
        cuts.append(point)
        middle = np.where(falls, middle, middle[:, [2, 1, 0, 3]])
        at, side = np.nonzero(middle >= 0)
        across.append(np.column_stack([at + sum(map(len, quads)), side, middle[at, side]]))
        quads.append(np.where(falls, quad, quad[:, ::-1]))
        regions.append(np.column_stack([np.maximum(low, high), np.minimum(low, high)]).astype(np.int64))
    return np.concatenate(quads), np.concatenate(across), np.concatenate(regions), np.concatenate(cuts)


def _meshed(
    quads: IntArray, across: IntArray, regions: IntArray, cuts: FloatArray
) -> tuple[ConformingSurface, FloatArray, IntArray]:
    """Split quadrilaterals (Q, 4); those with vertices across faces (M, 3) are fans around their cuts (Q, 3).

    Of these: the quadrilateral, the corner before, and a number after all other vertices.
    """
    large, side, extra = across.T + np.array([[0], [0], [quads.max(initial=-1) + 1]])
    polygon, which = np.unique(large, return_inverse=True)
    centre = max(quads.max(initial=-1), extra.max(initial=-1)) + 1 + np.arange(len(polygon))
    of = np.concatenate([np.repeat(np.arange(len(quads)), 4), large, polygon])
    vertex = np.concatenate([quads.ravel(), extra, centre])
    vertices = _mean_at(vertex, cuts, of)
    nearer = vertices + _mean_at(vertex, cuts - sum(vertices[corner] for corner in quads.T) / 4, of)
    del of, vertex
    rim = np.repeat(quads[polygon], 2, axis=1)
    rim[which, 2 * side + 1] = extra
    fans = np.stack([rim, np.roll(rim, -1, axis=1), np.repeat(centre[:, None], 8, axis=1)], axis=2)
    real = fans[..., 0] != fans[..., 1]
    plain = np.delete(np.arange(len(quads)), polygon)
    sides = np.concatenate([np.repeat(plain, 2), np.repeat(polygon, real.sum(axis=1))])
    triangles = np.concatenate([split_quads(vertices, quads[plain]), fans[real]])
    return ConformingSurface(vertices, triangles, regions[sides]), nearer, quads[plain]


def _mean_at(at: IntArray, values: FloatArray, of: IntArray) -> FloatArray:
    """Mean (V, 3) at each vertex (N,) of the values (Q, 3) of polygons (N,)."""
    return np.column_stack([np.bincount(at, along[of]) / np.bincount(at) for along in values.T])


class _Sheets(NamedTuple):
    """The sheets of surface in cells (C,)."""

    other: IntArray  # (C, 12) numbers of the sheets at the cells' edges; -1 for the first of each cell
    middle: IntArray  # (C, 12, 2) numbers of the vertices across the two faces at each edge; -1 for none
    pinched: IntArray  # (P,) cells in which a region touches itself in a vertex


def _sheets(labels: LabelArray, cells: IntArray, cut: Cut) -> _Sheets:
    """Part the sheets of surface in ambiguous cells (C, 3).

    Cuts of a cell's edges are of one sheet where walls join them in its faces. Two strips of wall pass across
    a face with a label that is `_joined_across` it. Between the same two sheets they would share an edge, so
    each has a vertex there; the outside may touch itself.
    """
    here = _corner_labels(labels, cells)
    ends, around = here[:, _EDGES], here[:, _FACES]
    cuts = ends[..., 0] != ends[..., 1]
    sides = cuts[:, _SIDES]
    four = sides.all(axis=2)
    across = (around[..., :2] == around[..., 2:]) & four[..., None]  # first and third, second and fourth
    cell, face = np.nonzero(across.any(axis=2))
    first, same = _joined_across(labels, cells[cell], face, cut)
    across[cell, face] = np.column_stack([first, ~first])
    both = sides[..., _LINKS].all(axis=3)
    both[..., :4] &= ~across[..., [0, 1, 0, 1]]
    both[..., 4:] &= ~four[..., None]
    at, on, link = np.nonzero(both)
    links = 12 * at[:, None] + _SIDES[on[:, None], _LINKS[link]]
    sheet = connected_parts(links[:, 0], links[:, 1], cuts.size).reshape(cuts.shape)
    other = np.full(cuts.shape, -1)
    more = cuts & (sheet != sheet[np.arange(len(sheet)), cuts.argmax(axis=1), None])
    other[more] = np.unique(sheet[more], return_inverse=True)[1]
    strips = np.where(first[:, None], _SIDES[face], np.roll(_SIDES[face], 1, axis=1))
    alike = (sheet[cell, strips[:, 0]] == sheet[cell, strips[:, 2]]) & (around[cell, face, 1 - first] > 0)
    twice = np.bincount(same, alike) == 2
    number = 2 * np.where(twice, np.cumsum(twice), 0)[same] - 2
    middle = np.full((*cuts.shape, 2), -1)
    for side, edge in enumerate(strips.T):
        middle[cell, edge, (face // 2 - edge // 4 - 1) % 3] = np.maximum(number + side // 2, -1)
    return _Sheets(other, middle, _pinched(ends.reshape(-1, 2), cuts, sheet.ravel(), links))


def _pinched(ends: LabelArray, cuts: BoolArray, sheet: IntArray, links: IntArray) -> IntArray:
    """Cells in which a region, but for the outside, has two rims in one sheet.

    Edges (E,) of all cells, with labels (E, 2) at their ends, are linked (L, 2) in faces; the sides of walls
    that one label has are its rims.
    """
    same = ends[links[:, 0], :, None] == ends[links[:, 1], None]
    link, one, other = np.nonzero(same)
    rims = connected_parts(2 * links[link, 0] + one, 2 * links[link, 1] + other, ends.size)
    edge = np.flatnonzero(cuts)
    label, rim = ends[edge].ravel().astype(np.int64), rims.reshape(-1, 2)[edge].ravel()
    key = np.repeat(sheet[edge], 2) * (label.max(initial=0) + 1) + label
    _, begin, which = np.unique(key, return_index=True, return_inverse=True)
    return np.unique(np.repeat(edge // 12, 2)[(rim != rim[begin[which]]) & (label > 0)])


def _joined_across(
    labels: LabelArray, cells: IntArray, face: IntArray, cut: Cut
) -> tuple[BoolArray, IntArray]:
    """Whether the first corner's label is joined across faces; else the second's.

    Of two labels at opposite corners it is not the outside, or decided by the value where the distance
    between them, linear along edges, has its saddle. For cells (K, 3); numbers of their faces, too.
    """
    corners = cells[:, None] + _CORNERS[_FACES[face]]
    keys = np.ravel_multi_index(tuple(corners[:, 0].T), labels.shape) * 3 + face // 2
    _, once, same = np.unique(keys, return_index=True, return_inverse=True)
    corners = corners[once].transpose(1, 0, 2)
    p, q, r, s = (labels[tuple(nodes.T)] for nodes in corners)
    here, there = cut(corners[0], corners[1], p, q), cut(corners[3], corners[2], s, r)
    first = np.where((here == there) | (p == 0) | (q == 0), p > q, here > there)
    return ((q != s) | ((p == r) & first))[same], same


def split_quads(vertices: FloatArray, quads: IntArray) -> IntArray:
    """Triangles (2 Q, 3) of quadrilaterals (Q, 4), split along their shorter diagonals."""
    ac, bd = (np.linalg.norm(vertices[quads[:, n]] - vertices[quads[:, n + 2]], axis=1) for n in (0, 1))
    return _halves(quads, ac <= bd)


def split_again(surface: ConformingSurface, quads: IntArray) -> ConformingSurface:
    """Split the quadrilaterals of `surface_nets` along the diagonals at which their triangles turn less.

    Smoothing straightens lines between walls: where three corners lie on one, the diagonal that was the
    shorter one may come to lie outside of the quadrilateral, and its triangles fold.

    Parameters
    ----------
    surface : ConformingSurface
    quads : (Q, 4) int
        Whose halves are its first triangles.
    """
    slabs = np.array_split(quads, len(quads) // SLAB_QUADS + 1)
    turned = [_turned_less(surface.vertices, slab) for slab in slabs]
    return replace(surface, triangles=np.concatenate([*turned, surface.triangles[2 * len(quads) :]]))


def _turned_less(vertices: FloatArray, quads: IntArray) -> IntArray:
    """Triangles (2 Q, 3) of quadrilaterals (Q, 4), split along the diagonals at which they turn less."""
    cosines: list[FloatArray] = []
    for choice in (True, False):
        normals = Mesh(vertices, _halves(quads, np.full(len(quads), choice))).unit_normals.reshape(-1, 2, 3)
        cosines.append((normals[:, 0] * normals[:, 1]).sum(axis=1))
    return _halves(quads, cosines[0] >= cosines[1])


def _halves(quads: IntArray, at_first: BoolArray) -> IntArray:
    """Triangles (2 Q, 3) of quadrilaterals, split from the first corner or from the second."""
    a, b, c, d = quads.T
    return np.column_stack([a, b, np.where(at_first, c, d), np.where(at_first, a, b), c, d]).reshape(-1, 3)
