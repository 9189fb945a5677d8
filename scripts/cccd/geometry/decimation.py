"""Fewer triangles of the same topology: edges collapse by quadric error where the link condition holds.

Quadrics are those of Garland and Heckbert (1997), weighted by area. An edge collapses only where its two ends
have no neighbours in common but the two across it (Dey et al. 1999), so that a closed manifold stays one and
keeps its genus, and where no triangle turns away from the normals around it. Edges whose ends are not
neighbours cannot disturb each other: in a round many of them collapse at once, the cheapest around them.

`fast_simplification` and VTK do not keep the topology, manifold3d changes the genus of fine trees, libigl's
takes twice as long and lets triangles cross; none of them weighs vertices or keeps the lines between parts.
The first goes ahead where nothing is weighed and the topology happens to stay.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from cccd.geometry.arrays import BoolArray, FloatArray, IntArray, ranks_of, unit_vectors
from cccd.geometry.distance import nearest_faces
from cccd.geometry.mesh import Mesh
from cccd.tolerances import TINY

#: Most triangles around a vertex: more would make quads of the layout needles.
MOST_AROUND = 14

#: Share of the area that pulls a new vertex to the middle of its edge where the quadric leaves it free.
_TO_THE_MIDDLE = 1e-3

#: Least cosine between a triangle's normal and the mean of those at its vertices.
_LEAST_COSINE = 0.2

#: Triangles are no slivers whose doubled area is at least this share of their squared edges' sum.
_SLIVER = 1e-6

#: Edges that may collapse in a round: this share, the cheapest of all. With more the triangles lie farther
#: from what they came of.
CHEAPEST = 0.2

#: Times that a round looks for edges beside those that it has found already.
PASSES = 3

#: `fast_simplification` goes ahead to so many times the triangles that are to be left, where these need be no
#: more even than this weight makes them.
_AHEAD, _UNEVEN = 1.5, 1e-3

#: With so many times the triangles that were wanted no further ones go.
_STUCK = 1.1

#: Where triangles shall be smaller each becomes so many: edges half as long.
_SPLIT = 4.0

#: Every round starts from so many times the triangles that are to be left: enough to choose from.
_SPARE = 8

#: Times that they are made dearer; what passes through itself then does so with so few triangles.
_DEARER_ROUNDS = 8


def collapse_edges(
    mesh: Mesh,
    most: int,
    evenness: float = 1e-4,
    weights: FloatArray | None = None,
    parts: IntArray | None = None,
) -> Mesh:
    """Collapse edges of a closed manifold, cheapest first, until it has at most so many triangles.

    Parameters
    ----------
    mesh : Mesh
        A closed manifold, oriented.
    most : int
        Triangles to be left; more are left where none can go without changing the topology.
    evenness : float
        Weight of edges' squared lengths beside squared distances: more makes triangles of one size.
    weights : (V,) float64, optional
        Factors of what edges cost at the vertices; 1 by default.
    parts : (F,) int64, optional
        Which part of the surface each triangle is of. The lines between parts stay: their vertices move along
        them alone, no edge joins them across, and no triangle of a lower part gets all its corners on one.

    Returns
    -------
    Mesh
        A closed manifold of the same genus, without unused vertices.

    Examples
    --------
    >>> import trimesh
    >>> ball = trimesh.creation.icosphere(3, 10.0)
    >>> few = collapse_edges(Mesh(np.array(ball.vertices), np.array(ball.faces, np.int64)), 100)
    >>> len(few.faces), few.is_closed_manifold, few.genus
    (100, True, 0)
    """
    if len(mesh.faces) <= most:
        return mesh
    if evenness <= _UNEVEN and weights is None and (parts is None or np.ptp(parts) == 0):
        mesh, parts = ahead(mesh, int(_AHEAD * most)), None
    middle = mesh.vertices.mean(axis=0)
    scale = float(np.abs(mesh.vertices - middle).max())
    scaled = Mesh((mesh.vertices - middle) / scale, mesh.faces)
    part = np.zeros(len(mesh.faces), np.int64) if parts is None else np.asarray(parts, np.int64)
    collapsing = _Collapsing.of(scaled, part, np.ones(len(mesh.vertices)) if weights is None else weights)
    while len(collapsing.faces) > most and collapsing.round(
        (len(collapsing.faces) - most + 1) // 2, evenness
    ):
        pass
    return Mesh(collapsing.points * scale + middle, collapsing.faces).compact()


def collapse_apart(mesh: Mesh, most: int) -> Mesh:
    """Collapse edges as `collapse_edges` does, fewer of them where triangles would pass through each other.

    Thin gaps and walls, which the distance to planes does not see, keep smaller triangles in this way.

    Parameters
    ----------
    mesh : Mesh
        A closed manifold, oriented.
    most : int
        Triangles to be left.

    Returns
    -------
    Mesh
        Of some rounds the first in which no triangles pass through each other, or that with the fewest.

    Examples
    --------
    >>> import trimesh
    >>> ball = trimesh.creation.icosphere(3, 10.0)
    >>> few = collapse_apart(Mesh(np.array(ball.vertices), np.array(ball.faces, np.int64)), 100)
    >>> len(few.faces), len(few.self_intersections())
    (100, 0)
    """
    mesh = collapse_edges(mesh, _SPARE * most)
    weights = np.ones(len(mesh.vertices))
    best, fewest = mesh, np.inf
    for _ in range(_DEARER_ROUNDS):
        kept = collapse_edges(mesh, most, weights=weights)
        pairs = kept.self_intersections()
        if len(pairs) < fewest:
            best, fewest = kept, len(pairs)
        if fewest == 0 or kept is mesh:
            break
        passing = np.zeros(len(kept.faces), np.bool_)
        passing[pairs.ravel()] = True
        weigh_more(weights, mesh, kept, np.where(kept.with_neighbours(passing), _SPLIT, 1.0))
    return best


def weigh_more(weights: FloatArray, mesh: Mesh, fewer: Mesh, times: FloatArray) -> None:
    """Change a mesh's weights (V,) so that each triangle of what it collapsed to becomes so many (F,)."""
    weights *= times[nearest_faces(mesh.vertices, fewer)] ** 2


def ahead(mesh: Mesh, most: int) -> Mesh:
    """Collapse edges five times as fast, to half the triangles at a time while that keeps the topology.

    Vertices move off the planes of flat sides by rounding.
    """
    while len(mesh.faces) > most:
        wanted = max(most, len(mesh.faces) // 2)
        fewer, pieces = mesh.simplified(wanted), mesh.count_pieces()
        if not fewer.is_closed_manifold or (fewer.genus, fewer.count_pieces()) != (mesh.genus, pieces):
            break
        mesh = fewer
        if len(fewer.faces) > _STUCK * wanted:
            break
    return mesh


@dataclass(frozen=True, eq=False)
class Quadrics:
    """Squared distances to the planes around vertices, weighted by area (Garland and Heckbert 1997).

    Attributes
    ----------
    values : (V, 10) float64
        Upper triangles of the 4 x 4 matrices.
    areas : (V,) float64
        Of the triangles that they are of.
    """

    values: FloatArray
    areas: FloatArray

    @classmethod
    def of(cls, mesh: Mesh, weights: FloatArray | None = None) -> Quadrics:
        """Add them up at the vertices of a mesh, with factors (V,)."""
        area = np.linalg.norm(mesh.face_normals, axis=1) / 2
        unit = mesh.face_normals / np.maximum(2 * area, TINY)[:, None]
        plane = np.column_stack([unit, -np.einsum("fc,fc->f", unit, mesh.vertices[mesh.faces[:, 0]])])
        rows, columns = np.triu_indices(4)
        total = _at_corners(mesh, np.column_stack([area[:, None] * plane[:, rows] * plane[:, columns], area]))
        total = total if weights is None else total * weights[:, None]
        return cls(total[:, :10], total[:, 10])

    def best(self, u: IntArray, v: IntArray, points: FloatArray) -> FloatArray:
        """Points (E, 3) of the least error to which vertices u and v (E,) join, near the middles between."""
        quadric = (self.values[u] + self.values[v]).T
        pull = _TO_THE_MIDDLE * (self.areas[u] + self.areas[v]) + TINY
        right = pull * ((points[u] + points[v]) / 2).T - quadric[[3, 6, 8]]
        return _solved(quadric[[0, 4, 7]] + pull, quadric[[1, 2, 5]], right).T

    def cost(
        self, u: IntArray, v: IntArray, points: FloatArray, to: FloatArray, evenness: float
    ) -> FloatArray:
        """Cost (E,) of joining vertices u and v (E,) at points ``to`` (E, 3); see `collapse_edges`."""
        quadric, (x, y, z) = (self.values[u] + self.values[v]).T, to.T
        error = quadric[0] * x * x + quadric[4] * y * y + quadric[7] * z * z + quadric[9]
        error += 2 * (quadric[1] * x * y + quadric[2] * x * z + quadric[5] * y * z)
        error += 2 * (quadric[3] * x + quadric[6] * y + quadric[8] * z)
        square = ((points[u] - points[v]) ** 2).sum(axis=1)
        return error + evenness * (self.areas[u] + self.areas[v]) * square

    def merged(self, u: IntArray, v: IntArray, kept: BoolArray) -> Quadrics:
        """Let v take over what u (E,) has, and keep some (V,); no two edges have an end in common."""
        values, areas = self.values.copy(), self.areas.copy()
        values[v] += values[u]
        areas[v] += areas[u]
        return Quadrics(values[kept], areas[kept])


def _at_corners(mesh: Mesh, values: FloatArray) -> FloatArray:
    """Add up at the vertices (V, n) what the triangles there have (F, n)."""
    corners, count = mesh.faces.ravel(), len(mesh.faces)
    at = csr_array(
        (np.ones(len(corners)), (corners, np.repeat(np.arange(count), 3))), shape=(len(mesh.vertices), count)
    )
    return np.asarray(at @ values)


@dataclass
class _Edges:
    """Edges (E,) that may collapse: their ends, and the points that they become."""

    u: IntArray
    v: IntArray
    to: FloatArray  # (E, 3)

    def take(self, chosen: IntArray | BoolArray | slice) -> _Edges:
        return _Edges(self.u[chosen], self.v[chosen], self.to[chosen])


@dataclass
class _Collapsing:
    """A closed manifold whose edges collapse."""

    faces: IntArray  # (F, 3)
    part: IntArray  # (F,)
    points: FloatArray  # (V, 3)
    quadrics: Quadrics
    normals: FloatArray  # (V, 3), weighted by area
    line: IntArray  # (V,), the largest part that meets another one there; -1 within a part

    @classmethod
    def of(cls, mesh: Mesh, part: IntArray, weights: FloatArray) -> _Collapsing:
        """Add up quadrics and normals at the vertices of a mesh."""
        count, corners = len(mesh.vertices), mesh.faces.ravel()
        least, most = np.full(count, part.max()), np.full(count, part.min())
        np.minimum.at(least, corners, np.repeat(part, 3))
        np.maximum.at(most, corners, np.repeat(part, 3))
        return cls(
            mesh.faces,
            part,
            mesh.vertices,
            Quadrics.of(mesh, weights),
            _at_corners(mesh, mesh.face_normals / 2),
            np.where(least < most, most, -1),
        )

    def round(self, most: int, evenness: float) -> bool:
        """Collapse at most so many edges, none beside another, and say whether any did."""
        around = _Around(self.faces, len(self.points))
        edges, cost = self._edges(evenness)
        cheap = np.argpartition(cost, min(int(CHEAPEST * len(cost)), len(cost) - 1))
        cheap = cheap[: max(1, int(CHEAPEST * len(cost)))]
        cheap = cheap[np.lexsort((cheap, cost[cheap]))]
        chosen = self._apart(edges.take(cheap), around, PASSES)
        if not len(chosen.u):  # what was too dear may do
            chosen = self._apart(edges.take(np.argsort(cost, kind="stable")), around, len(edges.u))
        self._merge(chosen.take(slice(most)))
        return bool(len(chosen.u))

    def _edges(self, evenness: float) -> tuple[_Edges, FloatArray]:
        """All edges that keep the lines between parts, and their costs (E,)."""
        starts, ends = self.faces.ravel(), np.roll(self.faces, -1, axis=1).ravel()
        once = starts < ends
        u, v = starts[once], ends[once]
        if np.any(self.line >= 0):
            both = (self.line[u] >= 0) & (self.line[v] >= 0)
            both[both] = ~self._along_lines(u[both], v[both])
            u, v = u[~both], v[~both]
        cost, to = self._cost(u, v, evenness)
        return _Edges(u, v, to), cost

    def _along_lines(self, u: IntArray, v: IntArray) -> BoolArray:
        """Whether edges with both ends on lines between parts are of one themselves."""
        count = len(self.points)
        starts, ends = self.faces.ravel(), np.roll(self.faces, -1, axis=1).ravel()
        keys = starts * count + ends
        order = np.argsort(keys)
        sides = [
            order[np.searchsorted(keys, side, sorter=order)] // 3 for side in (u * count + v, v * count + u)
        ]
        return self.part[sides[0]] != self.part[sides[1]]

    def _cost(self, u: IntArray, v: IntArray, evenness: float) -> tuple[FloatArray, FloatArray]:
        """Cost (E,) of joining two vertices, and the points (E, 3) of least quadric error they move to."""
        to = self.quadrics.best(u, v, self.points)
        to = np.where(self.line[u][:, None] >= 0, self.points[u], to)
        to = np.where(self.line[v][:, None] >= 0, self.points[v], to)
        return self.quadrics.cost(u, v, self.points, to, evenness), to

    def _apart(self, edges: _Edges, around: _Around, passes: int) -> _Edges:
        """Choose edges that may collapse at once, cheapest first."""
        waiting, chosen = np.arange(len(edges.u)), np.zeros(0, np.int64)
        for _ in range(passes):
            here = edges.take(waiting)
            first = around.first_around(here.u, here.v)
            tried = waiting[first]
            good = self._may_collapse(edges.take(tried), around)
            chosen = np.concatenate([chosen, tried[good]])
            near = around.reached(np.concatenate([edges.u[chosen], edges.v[chosen]]))
            waiting = waiting[~first]
            waiting = waiting[~(near[edges.u[waiting]] | near[edges.v[waiting]])]
            if not len(waiting):
                break
        chosen.sort()
        return edges.take(chosen)

    def _may_collapse(self, edges: _Edges, around: _Around) -> BoolArray:
        """Whether collapsing edges (E,) keeps the topology, and all triangles on their sides."""
        good = around.keep_topology(edges.u, edges.v)
        good[good] = self._keep_sides(edges.take(good), around)
        return good

    def _keep_sides(self, edges: _Edges, around: _Around) -> BoolArray:
        """Whether no triangle around edges (E,) turns over or becomes a sliver when they collapse."""
        joined = unit_vectors(self.normals[edges.u] + self.normals[edges.v])
        good = np.ones(len(edges.u), np.bool_)
        for x, y in ((edges.u, edges.v), (edges.v, edges.u)):
            edge, corner = around.corners(x)
            face, k = np.divmod(corner, 3)
            g, h = self.faces[face, (k + 1) % 3], self.faces[face, (k + 2) % 3]
            stays = (g != y[edge]) & (h != y[edge])
            face, edge, g, h = face[stays], edge[stays], g[stays], h[stays]
            # what has its three points on the line of one part looks like a triangle of that part
            line = self.line[y[edge]]
            like = (line == self.line[g]) & (line == self.line[h]) & (line != self.line[x[edge]])
            good[edge[like & (line > self.part[face])]] = False
            a, b = self.points[g], self.points[h]
            normal, edges2 = doubled(edges.to[edge], a, b)
            size = np.linalg.norm(normal, axis=1)
            there = joined[edge] + unit_vectors(self.normals[g]) + unit_vectors(self.normals[h])
            turned = (normal * there).sum(axis=1) < _LEAST_COSINE * size * np.linalg.norm(there, axis=1)
            old, old_edges2 = doubled(self.points[x[edge]], a, b)
            thinner = size * old_edges2 < np.linalg.norm(old, axis=1) * edges2
            good[edge[turned | ((size < _SLIVER * edges2) & thinner)]] = False
        return good

    def _merge(self, edges: _Edges) -> None:
        """Collapse edges, none beside another."""
        u, v = edges.u, edges.v
        self.normals[v] += self.normals[u]
        self.points[v] = edges.to
        self.line[v] = np.maximum(self.line[v], self.line[u])
        kept = np.ones(len(self.points), np.bool_)
        kept[u] = False
        number = np.cumsum(kept) - 1
        number[u] = number[v]
        faces = number[self.faces]
        left = np.all(faces != np.roll(faces, 1, axis=1), axis=1)
        self.faces, self.part = faces[left], self.part[left]
        self.quadrics = self.quadrics.merged(u, v, kept)
        self.points, self.normals, self.line = self.points[kept], self.normals[kept], self.line[kept]


class _Around:
    """What is around the vertices of a closed manifold, whose neighbours all follow them in one triangle."""

    def __init__(self, faces: IntArray, count: int) -> None:
        corners = np.arange(faces.size)
        found = csr_array((corners, (faces.ravel(), corners)), shape=(count, faces.size))
        self._corners, self._offsets = found.indices.astype(np.int64), found.indptr.astype(np.int64)
        self._beside = faces.ravel()[self._corners // 3 * 3 + (self._corners + 1) % 3]

    def _ragged(self, vertices: IntArray) -> tuple[IntArray, IntArray]:
        """Rows of the lists of vertices (N,): which of them each is of, and where it stands."""
        sizes = self._offsets[vertices + 1] - self._offsets[vertices]
        owner = np.repeat(np.arange(len(vertices)), sizes)
        return owner, self._offsets[vertices][owner] + ranks_of(sizes)

    def corners(self, vertices: IntArray) -> tuple[IntArray, IntArray]:
        """Corners (3 * face + 0, 1, 2) at vertices (N,): which of these each is of, and the corner."""
        owner, place = self._ragged(vertices)
        return owner, self._corners[place]

    def neighbours(self, vertices: IntArray) -> tuple[IntArray, IntArray]:
        """Neighbours of vertices (N,): which of these each is of, and the neighbour."""
        owner, place = self._ragged(vertices)
        return owner, self._beside[place]

    def reached(self, vertices: IntArray) -> BoolArray:
        """Which vertices (V,) are among some, or beside them."""
        found = np.zeros(len(self._offsets) - 1, np.bool_)
        found[vertices] = True
        found[self.neighbours(vertices)[1]] = True
        return found

    def first_around(self, u: IntArray, v: IntArray) -> BoolArray:
        """Which of edges (E,) come before all others that have an end beside one of theirs."""
        count = len(self._offsets) - 1
        first = np.full(count, len(u))
        for ends in (u, v):
            np.minimum.at(first, ends, np.arange(len(u)))
        near = first.copy()
        np.minimum.at(near, np.repeat(np.arange(count), np.diff(self._offsets)), first[self._beside])
        return (near[u] == np.arange(len(u))) & (near[v] == np.arange(len(u)))

    def keep_topology(self, u: IntArray, v: IntArray) -> BoolArray:
        """Whether the ends of edges (E,) share two neighbours and no more, and have not too many together."""
        count, sizes = len(self._offsets) - 1, np.diff(self._offsets)
        keys = np.concatenate([owner * count + beside for owner, beside in map(self.neighbours, (u, v))])
        keys.sort()
        edge, across = np.divmod(keys[1:][keys[1:] == keys[:-1]], count)
        shared = np.bincount(edge, minlength=len(u))
        good = (shared == 2) & (sizes[u] + sizes[v] - 4 <= MOST_AROUND)
        # a vertex across keeps three neighbours at least, whatever collapses around it
        lost = np.bincount(across[good[edge]], minlength=count)
        good[edge[sizes[across] - lost[across] < 3]] = False
        return good


def _solved(diagonal: FloatArray, beside: FloatArray, right: FloatArray) -> FloatArray:
    """Solve symmetric systems of three: xx, yy, zz (3, N), xy, xz, yz (3, N), right sides (3, N)."""
    (xx, yy, zz), (xy, xz, yz), (rx, ry, rz) = diagonal, beside, right
    i, j, k = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
    m, n, o = xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy
    solution = np.stack([i * rx + j * ry + k * rz, j * rx + m * ry + n * rz, k * rx + n * ry + o * rz])
    return solution / (xx * i + xy * j + xz * k)


def doubled(a: FloatArray, b: FloatArray, c: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return normals (N, 3) of triangles, as long as twice their areas, and sums (N,) of squared edges."""
    ab, ac, bc = b - a, c - a, c - b
    x = ab[:, 1] * ac[:, 2] - ab[:, 2] * ac[:, 1]
    y = ab[:, 2] * ac[:, 0] - ab[:, 0] * ac[:, 2]
    z = ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0]
    return np.column_stack([x, y, z]), (ab * ab + ac * ac + bc * bc).sum(axis=1)
