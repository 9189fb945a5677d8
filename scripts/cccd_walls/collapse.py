"""Fewer triangles of a complex of walls: edges collapse by quadric error, seams along themselves.

As `cccd.geometry.decimation.collapse_edges` for one closed surface. Corners stay, what is on a seam goes to
an end of its edge, and an edge collapses only where its ends have no neighbours in common but those across it
(Dey et al. 1999), none of which is on a seam with both.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array, csr_array

from cccd.geometry.arrays import BoolArray, FloatArray, IntArray, ranks_of, unit_vectors
from cccd.geometry.decimation import CHEAPEST, MOST_AROUND, PASSES, Quadrics, doubled
from cccd.geometry.mesh import Mesh
from cccd_walls.complexes import SEAM, WITHIN, WallComplex

#: Least cosine between a triangle's normal and the mean of its own before and of those at its corners.
LEAST_COSINE = 0.3
#: No triangle becomes thinner whose doubled area is less than this share of its squared edges' sum.
SLIVER = 1e-2
#: Weight of edges' squared lengths beside squared distances: needles make needles of quads.
EVENNESS = 1e-3
#: Triangles that stand on walls along seams are so many times as high as these edges are long.
SEAMS = 1.0


def collapse_walls(walls: WallComplex, most: int, weights: FloatArray | None = None) -> WallComplex:
    """Collapse edges of walls, cheapest first, until there are at most so many triangles.

    Parameters
    ----------
    walls : WallComplex
    most : int
        More are left where none can go without changing the topology.
    weights : (V,) float64, optional
        Factors of what edges cost at the vertices; 1 by default.

    Returns
    -------
    WallComplex
        Of the same topology; its vertices on seams are some of those before.
    """
    quadrics = _quadrics(walls, weights)
    while len(walls.triangles) > most:
        fewer, quadrics = _round(walls, quadrics, (len(walls.triangles) - most + 1) // 2)
        if len(fewer.triangles) == len(walls.triangles):
            break
        walls = fewer
    return walls


def _quadrics(walls: WallComplex, weights: FloatArray | None) -> Quadrics:
    """Squared distances to the planes of walls, and along seams to those that stand on these.

    Without the latter a seam may go anywhere on walls that are one plane (Garland and Heckbert 1997).
    """
    face, side = np.nonzero(walls.edges.seam[walls.edges.side])
    ends = walls.triangles[face[:, None], (side[:, None] + [0, 1]) % 3]
    a, b = walls.vertices[ends.T]
    length = np.linalg.norm(a - b, axis=1, keepdims=True)
    tips = b + SEAMS * length * unit_vectors(walls.mesh.face_normals[face])
    count = len(walls.vertices)
    fences = np.column_stack([ends, count + np.arange(len(ends))])
    both = Mesh(np.concatenate([walls.vertices, tips]), np.concatenate([walls.triangles, fences]))
    weights = np.ones(count) if weights is None else weights
    all_of_them = Quadrics.of(both, np.concatenate([weights, np.ones(len(tips))]))
    return Quadrics(all_of_them.values[:count], all_of_them.areas[:count])


@dataclass(frozen=True, eq=False)
class _Edges:
    """Edges (E,) that may collapse: of u and v the latter stays, at ``to`` (E, 3); triangles along each."""

    u: IntArray
    v: IntArray
    to: FloatArray
    uses: IntArray

    def take(self, chosen: IntArray | BoolArray) -> _Edges:
        return _Edges(self.u[chosen], self.v[chosen], self.to[chosen], self.uses[chosen])


def _round(walls: WallComplex, quadrics: Quadrics, most: int) -> tuple[WallComplex, Quadrics]:
    """Collapse at most so many edges, none beside another."""
    edges, kinds = walls.edges, walls.kinds
    u, v = edges.ends.T
    u, v = np.where(kinds[u] > kinds[v], v, u), np.where(kinds[u] > kinds[v], u, v)
    along = (kinds[u] == WITHIN) | (edges.seam & (kinds[u] == SEAM))
    u, v = u[along], v[along]
    stays = kinds[v][:, None] > WITHIN
    to = np.where(stays, walls.vertices[v], quadrics.best(u, v, walls.vertices))
    cost = quadrics.cost(u, v, walls.vertices, to, EVENNESS)
    cheap = np.argpartition(cost, min(int(CHEAPEST * len(cost)), len(cost) - 1))
    cheap = cheap[: max(1, int(CHEAPEST * len(cost)))]
    cheap = cheap[np.lexsort((cheap, cost[cheap]))]
    around, found = _Around(walls), _Edges(u, v, to, edges.uses[along])
    chosen = around.apart(found.take(cheap), PASSES)
    if not len(chosen.u):  # what was too dear may do
        chosen = around.apart(found.take(np.argsort(cost, kind="stable")), len(cost))
    return _merged(walls, quadrics, chosen.take(np.arange(min(most, len(chosen.u)))))


def _merged(walls: WallComplex, quadrics: Quadrics, edges: _Edges) -> tuple[WallComplex, Quadrics]:
    """Collapse edges, none beside another."""
    kept = np.ones(len(walls.vertices), np.bool_)
    kept[edges.u] = False
    number = np.cumsum(kept) - 1
    number[edges.u] = number[edges.v]
    vertices = walls.vertices.copy()
    vertices[edges.v] = edges.to
    triangles = number[walls.triangles]
    left = np.all(triangles != np.roll(triangles, 1, axis=1), axis=1)
    fewer = WallComplex(vertices[kept], triangles[left], walls.wall[left], walls.regions)
    return fewer, quadrics.merged(edges.u, edges.v, kept)


class _Around:
    """What is around the vertices of walls."""

    def __init__(self, walls: WallComplex) -> None:
        self._walls, self._count = walls, len(walls.vertices)
        corners = np.arange(walls.triangles.size)
        at = csr_array((corners, (walls.triangles.ravel(), corners)), shape=(self._count, len(corners)))
        self._corners = at.indptr.astype(np.int64), at.indices.astype(np.int64)
        ends = walls.edges.ends
        there, back = np.concatenate([ends, ends[:, ::-1]]).T
        shape = self._count, self._count
        links = coo_array((np.ones(len(there)), (there, back)), shape=shape).tocsr()
        self._beside = links.indptr.astype(np.int64), links.indices.astype(np.int64)
        self._valence = np.diff(self._beside[0])
        mesh, _, _ = walls.apart
        normals = unit_vectors(mesh.face_normals)
        self._normals = mesh.vertex_normals[mesh.faces].sum(axis=1) + normals
        self._seams = ends[walls.edges.seam] @ [self._count, 1]

    def _listed(self, lists: tuple[IntArray, IntArray], vertices: IntArray) -> tuple[IntArray, IntArray]:
        """Members of the lists of vertices (N,): which of these each is of, and the member."""
        offsets, members = lists
        sizes = offsets[vertices + 1] - offsets[vertices]
        owner = np.repeat(np.arange(len(vertices)), sizes)
        return owner, members[offsets[vertices][owner] + ranks_of(sizes)]

    def apart(self, edges: _Edges, passes: int) -> _Edges:
        """Choose edges that may collapse at once, the first ones first."""
        waiting, chosen = np.arange(len(edges.u)), np.zeros(0, np.int64)
        for _ in range(passes):
            first = self._first_around(edges.take(waiting))
            tried = waiting[first]
            chosen = np.concatenate([chosen, tried[self._may_collapse(edges.take(tried))]])
            near = np.zeros(self._count, np.bool_)
            near[edges.u[chosen]] = near[edges.v[chosen]] = True
            near[self._listed(self._beside, np.flatnonzero(near))[1]] = True
            waiting = waiting[~first]
            waiting = waiting[~(near[edges.u[waiting]] | near[edges.v[waiting]])]
            if not len(waiting):
                break
        chosen.sort()
        return edges.take(chosen)

    def _first_around(self, edges: _Edges) -> BoolArray:
        """Which edges come before all others that have an end beside one of theirs."""
        own = np.arange(len(edges.u))
        first = np.full(self._count, len(own))
        for ends in (edges.u, edges.v):
            np.minimum.at(first, ends, own)
        near = first.copy()
        np.minimum.at(near, np.repeat(np.arange(self._count), self._valence), first[self._beside[1]])
        return (near[edges.u] == own) & (near[edges.v] == own)

    def _may_collapse(self, edges: _Edges) -> BoolArray:
        """Whether collapsing edges keeps the topology, and all triangles on their sides."""
        good = self._keeps_topology(edges)
        good[good] = self._keeps_sides(edges.take(good))
        return good

    def _keeps_topology(self, edges: _Edges) -> BoolArray:
        u, v, count = edges.u, edges.v, self._count
        listed = [self._listed(self._beside, ends) for ends in (u, v)]
        keys = np.sort(np.concatenate([owner * count + beside for owner, beside in listed]))
        edge, across = np.divmod(keys[1:][keys[1:] == keys[:-1]], count)
        shared = np.bincount(edge, minlength=len(u))
        around = self._valence[u] + self._valence[v] - 2 * edges.uses
        good = (shared == edges.uses) & (2 * around <= MOST_AROUND * edges.uses)
        lost = np.bincount(across[good[edge]], minlength=count)
        good[edge[self._valence[across] - lost[across] < 3]] = False
        good[edge[self._on_seam(u[edge], across) & self._on_seam(v[edge], across)]] = False
        return good

    def _on_seam(self, one: IntArray, other: IntArray) -> BoolArray:
        return np.isin(np.minimum(one, other) * self._count + np.maximum(one, other), self._seams)

    def _keeps_sides(self, edges: _Edges) -> BoolArray:
        """Whether no triangle turns over, becomes a sliver or comes to lie on another one."""
        good, opposite = np.ones(len(edges.u), np.bool_), list[tuple[IntArray, IntArray]]()
        triangles, points = self._walls.triangles, self._walls.vertices
        for x, y in ((edges.u, edges.v), (edges.v, edges.u)):
            edge, corner = self._listed(self._corners, x)
            face, k = np.divmod(corner, 3)
            g, h = triangles[face, (k + 1) % 3], triangles[face, (k + 2) % 3]
            stays = (g != y[edge]) & (h != y[edge])
            edge, face, g, h = edge[stays], face[stays], g[stays], h[stays]
            opposite.append((edge, np.minimum(g, h) * self._count + np.maximum(g, h)))
            normal, around = doubled(edges.to[edge], points[g], points[h])
            size, there = np.linalg.norm(normal, axis=1), self._normals[face]
            turned = (normal * there).sum(axis=1) < LEAST_COSINE * size * np.linalg.norm(there, axis=1)
            old, old_around = doubled(points[x[edge]], points[g], points[h])
            thinner = size * old_around < np.linalg.norm(old, axis=1) * around
            good[edge[turned | ((size < SLIVER * around) & thinner)]] = False
        edge, side = (np.concatenate(part) for part in zip(*opposite, strict=True))
        order = np.lexsort((side, edge))
        edge, side = edge[order], side[order]
        good[edge[1:][(edge[1:] == edge[:-1]) & (side[1:] == side[:-1])]] = False
        return good
