"""Fewer triangles of the same topology: edges collapse by quadric error where the link condition holds.

Quadrics are those of Garland and Heckbert (1997), weighted by area. An edge collapses only where its two ends
have no neighbours in common but the two across it (Dey et al. 1999), so that a closed manifold stays one and
keeps its genus, and where no triangle turns away from the normals around it. Edges whose ends are not
neighbours cannot disturb each other: in a round many of them collapse at once, the cheapest around them.

`fast_simplification` and VTK do not keep the topology, manifold3d changes the genus of fine trees, libigl's
takes twice as long and lets triangles cross; none of them weighs vertices or keeps the lines between parts.
The first goes ahead where nothing is weighed and the topology happens to stay.

Parts, of which three or more may meet, end in seams. Where seams end a vertex stays, others on a seam go to
an end of its edge, and no two edges of seams become one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from cccd.geometry.arrays import BoolArray, FloatArray, IntArray, ranks_of, unit_vectors
from cccd.geometry.distance import nearest_faces
from cccd.geometry.mesh import Mesh
from cccd.geometry.subdivision import quad_edges
from cccd.tolerances import TINY

#: What a vertex lies on: a part alone, a seam, or where seams end.
WITHIN, SEAM, CORNER = 0, 1, 2

#: Most triangles around a vertex: more would make quads of the layout needles.
_MOST_AROUND = 14
#: Share of the area that pulls a new vertex to the middle of its edge where the quadric leaves it free.
_TO_THE_MIDDLE = 1e-3
#: Least cosine between a triangle's normal and the mean of those at its vertices.
_LEAST_COSINE = 0.2
#: Triangles are no slivers whose doubled area is at least this share of their squared edges' sum.
_SLIVER = 1e-6
#: Edges that may collapse in a round: this share, the cheapest of all. With more the triangles lie farther
#: from what they came of.
_CHEAPEST = 0.2
#: Times that a round looks for edges beside those that it has found already.
_PASSES = 3
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
    collapsing = Collapsing.of(scaled, part, weights)
    collapsing.collapse(most, evenness)
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


def quadrics_of(mesh: Mesh, weights: FloatArray | None) -> FloatArray:
    """Upper triangles of the vertices' matrices, by area and factors (V,), and these areas: (V, 11)."""
    area = np.linalg.norm(mesh.face_normals, axis=1) / 2
    unit = mesh.face_normals / np.maximum(2 * area, TINY)[:, None]
    plane = np.column_stack([unit, -np.einsum("fc,fc->f", unit, mesh.vertices[mesh.faces[:, 0]])])
    rows, columns = np.triu_indices(4)
    total = at_corners(mesh, np.column_stack([area[:, None] * plane[:, rows] * plane[:, columns], area]))
    return total if weights is None else total * weights[:, None]


def _least(quadric: FloatArray, middle: FloatArray) -> FloatArray:
    """Points (E, 3) of the least error of quadrics (11, E), near the middles (E, 3) of edges."""
    pull = _TO_THE_MIDDLE * quadric[10] + TINY
    right = pull * middle.T - quadric[[3, 6, 8]]
    return _solved(quadric[[0, 4, 7]] + pull, quadric[[1, 2, 5]], right).T


def _error(quadric: FloatArray, to: FloatArray) -> FloatArray:
    """Values (E,) of quadrics (11, E) at points (E, 3)."""
    x, y, z = to.T
    error = quadric[0] * x * x + quadric[4] * y * y + quadric[7] * z * z + quadric[9]
    error += 2 * (quadric[1] * x * y + quadric[2] * x * z + quadric[5] * y * z)
    return error + 2 * (quadric[3] * x + quadric[6] * y + quadric[8] * z)


def at_corners(mesh: Mesh, values: FloatArray) -> FloatArray:
    """Add up at the vertices (V, n) what the triangles there have (F, n)."""
    corners, count = mesh.faces.ravel(), len(mesh.faces)
    at = csr_array(
        (np.ones(len(corners)), (corners, np.repeat(np.arange(count), 3))), shape=(len(mesh.vertices), count)
    )
    return np.asarray(at @ values)


@dataclass(frozen=True, eq=False)
class Seams:
    """Edges between parts: ends (S, 2), the lower first, and uses (S,); the kinds (V,) of all vertices."""

    ends: IntArray
    uses: IntArray
    kinds: IntArray

    @classmethod
    def of(cls, faces: IntArray, part: IntArray, count: int) -> Seams:
        """Find the edges of triangles (F, 3) at which not two meet, or two of different parts (F,)."""
        edges, side = quad_edges(faces)
        uses, last = np.bincount(side.ravel(), minlength=len(edges)), np.zeros(len(edges), np.int64)
        seam, last[side] = uses != 2, part[:, None]
        seam[side[last[side] != part[:, None]]] = True
        at, each = edges[seam].ravel(), np.repeat(uses[seam], 2)
        number, total, squares = (np.bincount(at, each**power, count) for power in (0, 1, 2))
        goes_on = (number == 2) & (2 * squares == total**2)
        kinds = np.where(number == 0, WITHIN, np.where(goes_on, SEAM, CORNER))
        return cls(edges[seam], uses[seam], kinds)

    def merged(self, number: IntArray, kept: BoolArray) -> Seams:
        """Give vertices new numbers (V,), two the same where an edge collapses; some (V,) are kept."""
        ends = np.sort(number[self.ends], axis=1)
        long = ends[:, 0] < ends[:, 1]
        return Seams(ends[long], self.uses[long], self.kinds[kept])


@dataclass
class _Edges:
    """Edges (E,) that may collapse: u goes to v, and v to a point ``to``; ``uses`` triangles lie at each."""

    u: IntArray
    v: IntArray
    to: FloatArray  # (E, 3)
    uses: IntArray

    def take(self, chosen: IntArray | BoolArray | slice) -> _Edges:
        return _Edges(self.u[chosen], self.v[chosen], self.to[chosen], self.uses[chosen])


@dataclass
class Collapsing:
    """Triangles of oriented parts whose edges collapse."""

    faces: IntArray  # (F, 3)
    part: IntArray  # (F,)
    points: FloatArray  # (V, 3)
    quadrics: FloatArray  # (V, 11)
    seams: Seams
    normals: FloatArray  # (V, 3), weighted by area; none on seams
    largest: IntArray  # (V,), the largest part there

    @classmethod
    def of(cls, mesh: Mesh, part: IntArray, weights: FloatArray | None) -> Collapsing:
        """Begin with a mesh of parts (F,); edges at a vertex cost as many times more as its weight (V,)."""
        seams = Seams.of(mesh.faces, part, len(mesh.vertices))
        normals = np.where(seams.kinds[:, None] > WITHIN, 0, at_corners(mesh, mesh.face_normals / 2))
        largest = np.full(len(mesh.vertices), part.min(initial=0))
        np.maximum.at(largest, mesh.faces, part[:, None])
        return cls(
            mesh.faces, part, mesh.vertices.copy(), quadrics_of(mesh, weights), seams, normals, largest
        )

    def collapse(self, most: int, evenness: float) -> None:
        """Collapse edges in rounds until at most so many triangles are left, or none can go."""
        while len(self.faces) > most and self._round((len(self.faces) - most + 1) // 2, evenness):
            pass

    def _round(self, most: int, evenness: float) -> bool:
        """Collapse at most so many edges, none beside another, and say whether any did."""
        around = _Around(self.faces, self.seams)
        edges, cost = self._edges(around, evenness)
        cheap = np.argpartition(cost, min(int(_CHEAPEST * len(cost)), len(cost) - 1))
        cheap = cheap[: max(1, int(_CHEAPEST * len(cost)))]
        cheap = cheap[np.lexsort((cheap, cost[cheap]))]
        chosen = self._apart(edges.take(cheap), around, _PASSES)
        if not len(chosen.u):  # what was too dear may do
            chosen = self._apart(edges.take(np.argsort(cost, kind="stable")), around, len(edges.u))
        self._merge(chosen.take(slice(most)))
        return bool(len(chosen.u))

    def _edges(self, around: _Around, evenness: float) -> tuple[_Edges, FloatArray]:
        """All edges that keep the seams, and their costs (E,)."""
        once, kinds, seams = around.starts < around.ends, self.seams.kinds, len(self.seams.ends)
        u, v = around.starts[once], around.ends[once]
        u, v = np.where(kinds[u] > kinds[v], v, u), np.where(kinds[u] > kinds[v], u, v)
        uses = np.concatenate([np.full(len(u) - seams, 2), self.seams.uses])
        along = kinds[u] <= np.where(np.arange(len(u)) < len(u) - seams, WITHIN, SEAM)
        u, v, uses = u[along], v[along], uses[along]
        quadric, a, b = (self.quadrics[u] + self.quadrics[v]).T, self.points[u], self.points[v]
        to = np.where(kinds[v][:, None] > WITHIN, b, _least(quadric, (a + b) / 2))
        uneven = evenness * quadric[10] * ((a - b) ** 2).sum(axis=1)
        return _Edges(u, v, to, uses), _error(quadric, to) + uneven

    def _apart(self, edges: _Edges, around: _Around, passes: int) -> _Edges:
        """Choose edges that may collapse at once, cheapest first."""
        waiting, chosen = np.arange(len(edges.u)), np.zeros(0, np.int64)
        for _ in range(passes):
            first = around.first_around(edges.u[waiting], edges.v[waiting])
            tried = waiting[first]
            tried = tried[around.keep_topology(edges.take(tried))]
            chosen = np.concatenate([chosen, tried[self._keep_sides(edges.take(tried), around)]])
            near = around.reached(np.concatenate([edges.u[chosen], edges.v[chosen]]))
            waiting = waiting[~first]
            waiting = waiting[~(near[edges.u[waiting]] | near[edges.v[waiting]])]
            if not len(waiting):
                break
        chosen.sort()
        return edges.take(chosen)

    def _keep_sides(self, edges: _Edges, around: _Around) -> BoolArray:
        """Whether no triangle around edges (E,) turns over, becomes a sliver or comes to lie on another."""
        joined = unit_vectors(self.normals[edges.u] + self.normals[edges.v])
        good, on_seam, opposite = np.ones(len(edges.u), np.bool_), self.seams.kinds > WITHIN, list[IntArray]()
        for x, y in ((edges.u, edges.v), (edges.v, edges.u)):
            edge, corner = around.corners(x)
            face, k = np.divmod(corner, 3)
            g, h = self.faces[face, (k + 1) % 3], self.faces[face, (k + 2) % 3]
            stays = (g != y[edge]) & (h != y[edge])
            face, edge, g, h = face[stays], edge[stays], g[stays], h[stays]
            # what has its three points on the seams of one part looks like a triangle of that part
            part = self.largest[y[edge]]
            like = (part == self.largest[g]) & (part == self.largest[h]) & (part != self.largest[x[edge]])
            good[edge[like & (part > self.part[face])]] = False
            a, b = self.points[g], self.points[h]
            normal, edges2 = doubled(edges.to[edge], a, b)
            old, old_edges2 = doubled(self.points[x[edge]], a, b)
            size = np.linalg.norm(normal, axis=1)
            there = joined[edge] + unit_vectors(self.normals[g]) + unit_vectors(self.normals[h])
            near = on_seam[edges.v[edge]] | on_seam[g] | on_seam[h]
            there[near] += unit_vectors(old[near])
            turned = (normal * there).sum(axis=1) < _LEAST_COSINE * size * np.linalg.norm(there, axis=1)
            thinner = size * old_edges2 < np.linalg.norm(old, axis=1) * edges2
            good[edge[turned | ((size < _SLIVER * edges2) & thinner)]] = False
            both = on_seam[g] & on_seam[h]
            opposite.append(np.column_stack([edge, np.minimum(g, h), np.maximum(g, h)])[both])
        found, times = np.unique(np.concatenate(opposite), axis=0, return_counts=True)
        good[found[times > 1, 0]] = False
        return good

    def _merge(self, edges: _Edges) -> None:
        """Collapse edges, none beside another."""
        u, v = edges.u, edges.v
        self.normals[v] += np.where(self.seams.kinds[v][:, None] > WITHIN, 0, self.normals[u])
        self.points[v] = edges.to
        self.quadrics[v] += self.quadrics[u]
        self.largest[v] = np.maximum(self.largest[v], self.largest[u])
        kept = np.ones(len(self.points), np.bool_)
        kept[u] = False
        number = np.cumsum(kept) - 1
        number[u] = number[v]
        faces = number[self.faces]
        left = np.all(faces != np.roll(faces, 1, axis=1), axis=1)
        self.faces, self.part = faces[left], self.part[left]
        self.quadrics, self.seams = self.quadrics[kept], self.seams.merged(number, kept)
        self.points, self.normals, self.largest = self.points[kept], self.normals[kept], self.largest[kept]


class _Around:
    """What is around vertices: neighbours within a part follow them in one triangle, others are on seams.

    ``starts`` and ``ends`` are those of all edges in both directions, seams' last.
    """

    def __init__(self, faces: IntArray, seams: Seams) -> None:
        self._count, self._on_line = len(seams.kinds), seams.kinds > WITHIN
        self.starts, self.ends = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
        self._corners = self._links = _listed(self.starts, self._count)
        self._seams = seams.ends @ [self._count, 1]
        if len(seams.ends):
            within = ~self._on_seam(self.starts, self.ends)
            self.starts = np.concatenate([self.starts[within], *seams.ends.T])
            self.ends = np.concatenate([self.ends[within], *seams.ends.T[::-1]])
            self._links = _listed(self.starts, self._count)
        self._beside, self._sizes = self.ends[self._links[1]], np.diff(self._links[0])

    def corners(self, vertices: IntArray) -> tuple[IntArray, IntArray]:
        """Corners (3 * face + 0, 1, 2) at vertices (N,): which of these each is of, and the corner."""
        owner, place = _ragged(self._corners[0], vertices)
        return owner, self._corners[1][place]

    def neighbours(self, vertices: IntArray) -> tuple[IntArray, IntArray]:
        """Neighbours of vertices (N,): which of these each is of, and the neighbour."""
        owner, place = _ragged(self._links[0], vertices)
        return owner, self._beside[place]

    def reached(self, vertices: IntArray) -> BoolArray:
        """Which vertices (V,) are among some, or beside them."""
        found = np.zeros(self._count, np.bool_)
        found[vertices] = True
        found[self.neighbours(vertices)[1]] = True
        return found

    def first_around(self, u: IntArray, v: IntArray) -> BoolArray:
        """Which of edges (E,) come before all others that have an end beside one of theirs."""
        first = np.full(self._count, len(u))
        for ends in (u, v):
            np.minimum.at(first, ends, np.arange(len(u)))
        near = first.copy()
        np.minimum.at(near, np.repeat(np.arange(self._count), self._sizes), first[self._beside])
        return (near[u] == np.arange(len(u))) & (near[v] == np.arange(len(u)))

    def keep_topology(self, edges: _Edges) -> BoolArray:
        """Whether ends of edges (E,) share those across alone, and have not too many neighbours together."""
        u, v, count, sizes = edges.u, edges.v, self._count, self._sizes
        keys = np.concatenate([owner * count + beside for owner, beside in map(self.neighbours, (u, v))])
        keys.sort()
        edge, across = np.divmod(keys[1:][keys[1:] == keys[:-1]], count)
        shared = np.bincount(edge, minlength=len(u))
        around = sizes[u] + sizes[v] - 2 * edges.uses
        good = (shared == edges.uses) & (2 * around <= _MOST_AROUND * edges.uses)
        # a vertex across keeps three neighbours at least, whatever collapses around it
        lost = np.bincount(across[good[edge]], minlength=count)
        good[edge[sizes[across] - lost[across] < 3]] = False
        good[edge[self._on_seam(u[edge], across) & self._on_seam(v[edge], across)]] = False
        return good

    def _on_seam(self, one: IntArray, other: IntArray) -> BoolArray:
        """Whether edges (E,) are of seams."""
        found = self._on_line[one] & self._on_line[other]
        low, high = np.minimum(one[found], other[found]), np.maximum(one[found], other[found])
        found[found] = np.isin(low * self._count + high, self._seams)
        return found


def _listed(numbers: IntArray, count: int) -> tuple[IntArray, IntArray]:
    """Where numbers below ``count`` stand among some (N,): offsets of each one's places, and the places."""
    places = np.arange(len(numbers))
    found = csr_array((places, (numbers, places)), shape=(count, len(numbers)))
    return found.indptr.astype(np.int64), found.indices.astype(np.int64)


def _ragged(offsets: IntArray, vertices: IntArray) -> tuple[IntArray, IntArray]:
    """Rows of the lists of vertices (N,): which of them each is of, and where it stands."""
    sizes = offsets[vertices + 1] - offsets[vertices]
    owner = np.repeat(np.arange(len(vertices)), sizes)
    return owner, offsets[vertices][owner] + ranks_of(sizes)


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
