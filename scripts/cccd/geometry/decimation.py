"""Fewer triangles of the same topology: edges collapse by quadric error where the link condition holds.

Quadrics are those of Garland and Heckbert (1997), weighted by area. An edge collapses only where its two ends
have no neighbours in common but the two across it (Dey et al. 1999), so that a closed manifold stays one and
keeps its genus, and where no triangle turns away from the normals around it. `fast_simplification` and VTK
keep neither; manifold3d's changes the genus of fine trees.
"""

from __future__ import annotations

import heapq
from typing import NamedTuple

import numpy as np

from cccd.geometry._jit import jit, jit_within
from cccd.geometry.arrays import BoolArray, FloatArray, IntArray
from cccd.geometry.distance import nearest_faces
from cccd.geometry.mesh import Mesh
from cccd.geometry.triangles import Point, dot, point_of
from cccd.tolerances import TINY

__all__ = ["collapse_apart", "collapse_edges", "weigh_more"]

#: Most triangles around a vertex: more would make quads of the layout needles.
_MOST_AROUND = 14

#: Neighbours of a vertex are looked at up to this many.
_NEIGHBOURS = 256

#: Share of the area that pulls a new vertex to the middle of its edge where the quadric leaves it free.
_TO_THE_MIDDLE = 1e-3

#: Least cosine between a triangle's normal and the mean of those at its vertices.
_LEAST_COSINE = 0.2

#: Triangles are no slivers whose doubled area is at least this share of their squared edges' sum.
_SLIVER = 1e-6

#: Where triangles shall be smaller edges cost this many times as much: they become half as long.
_DEARER = 16.0

#: Every round starts from so many times the triangles that are to be left: enough to choose from.
_SPARE = 8

#: Times that they are made dearer; what passes through itself then does so with so few triangles.
_DEARER_ROUNDS = 8

#: A cost, and the point that it is of.
_Candidate = tuple[float, float, float, float]

#: The cost of joining two vertices, they, and how often they had moved.
_Offer = tuple[float, int, int, int, int]


class _Fans(NamedTuple):
    """Triangles that change, and the lists of their corners (3 * face + 0, 1, 2) at each vertex."""

    faces: IntArray  # (F, 3)
    alive: BoolArray  # (F,)
    part: IntArray  # (F,)
    first: IntArray  # (V,), first corner at each vertex
    last: IntArray  # (V,)
    following: IntArray  # (3 F,), next corner at the same vertex, or -1


class _Vertices(NamedTuple):
    """What is known at the vertices, which move."""

    points: FloatArray  # (V, 3)
    quadrics: FloatArray  # (V, 10), upper triangle of the 4 x 4 matrix
    areas: FloatArray  # (V,)
    normals: FloatArray  # (V, 3), weighted by area
    changes: IntArray  # (V,), how often the vertex moved; -1 when it is gone
    on_line: BoolArray  # (V,), whether faces of two parts meet there


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
        them alone, and no edge joins them across.

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
    middle = mesh.vertices.mean(axis=0)
    scale = float(np.abs(mesh.vertices - middle).max())
    part = np.zeros(len(mesh.faces), np.int64) if parts is None else np.asarray(parts, np.int64)
    fans = _fans(mesh.faces.copy(), part, len(mesh.vertices))
    vertices = _vertices((mesh.vertices - middle) / scale, mesh.faces, mesh.face_normals / scale**2, part)
    if weights is not None:
        vertices.quadrics[:] *= weights[:, None]
        vertices.areas[:] *= weights
    ring, other = np.empty((2, _NEIGHBOURS), np.int64)
    _collapse(fans, vertices, ring, other, most, evenness)
    return Mesh(vertices.points * scale + middle, fans.faces[fans.alive].astype(np.int64)).compact()


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
        weigh_more(weights, mesh, kept, kept.with_neighbours(passing))
    return best


def weigh_more(weights: FloatArray, mesh: Mesh, fewer: Mesh, where: BoolArray) -> None:
    """Change the weights (V,) of a mesh so that some triangles (F,) of what it collapsed to become four."""
    weights[where[nearest_faces(mesh.vertices, fewer)]] *= _DEARER


def _fans(faces: IntArray, part: IntArray, count: int) -> _Fans:
    """List each vertex's corners."""
    corners = faces.ravel()
    order = np.argsort(corners, kind="stable")
    following = np.full(faces.size, -1)
    same = corners[order[1:]] == corners[order[:-1]]
    following[order[:-1][same]] = order[1:][same]
    vertices = np.arange(count)
    first = order[np.searchsorted(corners[order], vertices)]
    last = order[np.searchsorted(corners[order], vertices, side="right") - 1]
    return _Fans(np.ascontiguousarray(faces), np.ones(len(faces), np.bool_), part, first, last, following)


def _vertices(points: FloatArray, faces: IntArray, doubled: FloatArray, part: IntArray) -> _Vertices:
    """Quadrics, areas and normals at the vertices."""
    count, corners = len(points), faces.ravel()
    area = np.linalg.norm(doubled, axis=1) / 2
    unit = doubled / np.maximum(2 * area, TINY)[:, None]
    plane = np.column_stack([unit, -np.einsum("fc,fc->f", unit, points[faces[:, 0]])])
    rows, columns = np.triu_indices(4)
    of_faces = np.column_stack([area[:, None] * plane[:, rows] * plane[:, columns], area, doubled / 2])
    at_vertices = np.zeros((count, 14))
    for n, column in enumerate(of_faces.T):
        at_vertices[:, n] = np.bincount(corners, np.repeat(column, 3), count)
    least, most = np.full(count, part.max()), np.full(count, part.min())
    np.minimum.at(least, corners, np.repeat(part, 3))
    np.maximum.at(most, corners, np.repeat(part, 3))
    return _Vertices(
        np.ascontiguousarray(points),
        np.ascontiguousarray(at_vertices[:, :10]),
        np.ascontiguousarray(at_vertices[:, 10]),
        np.ascontiguousarray(at_vertices[:, 11:]),
        np.zeros(count, np.int64),
        least < most,
    )


@jit
def _collapse(
    fans: _Fans, vertices: _Vertices, ring: IntArray, other: IntArray, most: int, evenness: float
) -> None:
    """Collapse the cheapest edges; what was refused once is tried again while anything else gives way."""
    left, before = len(fans.faces), len(fans.faces) + 1
    heap = [(0.0, 0, 0, 0, 0)]
    heap.pop()
    while left > most:
        if len(heap) == 0:
            if left == before:
                break
            before = left
            _offer_all(fans, vertices, heap, evenness)
            if len(heap) == 0:
                break
        _, u, v, changes_u, changes_v = heapq.heappop(heap)
        if left <= 4 or vertices.changes[u] != changes_u or vertices.changes[v] != changes_v:
            continue
        gone = _join(fans, vertices, u, v, ring, other, evenness)
        if gone:
            left -= gone
            _offer_around(fans, vertices, heap, v, ring, evenness)


@jit_within
def _join(
    fans: _Fans, vertices: _Vertices, u: int, v: int, ring: IntArray, other: IntArray, evenness: float
) -> int:
    """Join ``u`` to ``v`` where the surface allows it, and return how many triangles that takes away."""
    if vertices.on_line[u] and vertices.on_line[v] and not _along_line(fans, u, v):
        return 0
    to = _candidate(vertices, u, v, evenness)
    if not _keeps_topology(fans, u, v, ring, other) or not _keeps_sides(fans, vertices, u, v, to):
        return 0
    return _merge(fans, vertices, u, v, to)


@jit_within
def _offer_all(fans: _Fans, vertices: _Vertices, heap: list[_Offer], evenness: float) -> None:
    for f in range(len(fans.faces)):
        if fans.alive[f]:
            for k in range(3):
                u, v = fans.faces[f, k], fans.faces[f, (k + 1) % 3]
                if u < v:
                    _offer(vertices, heap, u, v, evenness)


@jit_within
def _offer_around(
    fans: _Fans, vertices: _Vertices, heap: list[_Offer], u: int, ring: IntArray, evenness: float
) -> None:
    for n in range(_neighbours(fans, u, ring)):
        _offer(vertices, heap, u, ring[n], evenness)


@jit_within
def _offer(vertices: _Vertices, heap: list[_Offer], u: int, v: int, evenness: float) -> None:
    cost = _candidate(vertices, u, v, evenness)[0]
    heapq.heappush(heap, (cost, u, v, vertices.changes[u], vertices.changes[v]))


@jit_within
def _candidate(vertices: _Vertices, u: int, v: int, evenness: float) -> _Candidate:
    """Cost of joining two vertices, and the point of least quadric error that they would move to."""
    m, n = vertices.quadrics[u], vertices.quadrics[v]
    q = (m[0] + n[0], m[1] + n[1], m[2] + n[2], m[3] + n[3], m[4] + n[4])
    r = (m[5] + n[5], m[6] + n[6], m[7] + n[7], m[8] + n[8], m[9] + n[9])
    area = vertices.areas[u] + vertices.areas[v]
    a, b = vertices.points[u], vertices.points[v]
    pull = _TO_THE_MIDDLE * area + TINY
    rx = pull * (a[0] + b[0]) / 2 - q[3]
    ry = pull * (a[1] + b[1]) / 2 - r[1]
    rz = pull * (a[2] + b[2]) / 2 - r[3]
    xx, yy, zz, xy, xz, yz = q[0] + pull, q[4] + pull, r[2] + pull, q[1], q[2], r[0]
    i, j, k = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
    determinant = xx * i + xy * j + xz * k
    x = (i * rx + j * ry + k * rz) / determinant
    y = (j * rx + (xx * zz - xz * xz) * ry + (xy * xz - xx * yz) * rz) / determinant
    z = (k * rx + (xy * xz - xx * yz) * ry + (xx * yy - xy * xy) * rz) / determinant
    if vertices.on_line[u]:
        x, y, z = a[0], a[1], a[2]
    if vertices.on_line[v]:
        x, y, z = b[0], b[1], b[2]
    squares = q[0] * x * x + q[4] * y * y + r[2] * z * z + r[4]
    error = squares + 2 * (xy * x * y + xz * x * z + yz * y * z + q[3] * x + r[1] * y + r[3] * z)
    length2 = (a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2
    return error + evenness * area * length2, x, y, z


@jit_within
def _neighbours(fans: _Fans, u: int, ring: IntArray) -> int:
    """Write the vertices beside one into ``ring`` and return their number; past the ring they are dropped."""
    count = 0
    corner = fans.first[u]
    while corner >= 0:
        f = corner // 3
        if fans.alive[f] and count < len(ring):
            # each neighbour follows the vertex in exactly one triangle around it
            ring[count] = fans.faces[f, (corner + 1) % 3]
            count += 1
        corner = fans.following[corner]
    return count


@jit_within
def _along_line(fans: _Fans, u: int, v: int) -> bool:
    """Whether the edge of two vertices on lines between parts is itself of one."""
    found, first = 0, 0
    corner = fans.first[u]
    while corner >= 0:
        f = corner // 3
        if fans.alive[f] and (fans.faces[f, 0] == v or fans.faces[f, 1] == v or fans.faces[f, 2] == v):
            if found and fans.part[f] != first:
                return True
            found, first = found + 1, fans.part[f]
        corner = fans.following[corner]
    return False


@jit_within
def _keeps_topology(fans: _Fans, u: int, v: int, ring: IntArray, other: IntArray) -> bool:
    """Whether two neighbours share two others and no more, and will not have too many together."""
    a, b = _neighbours(fans, u, ring), _neighbours(fans, v, other)
    if a >= _NEIGHBOURS or b >= _NEIGHBOURS or a + b - 4 > _MOST_AROUND:
        return False
    shared = 0
    for n in range(a):
        for m in range(b):
            if ring[n] == other[m]:
                shared += 1
    return shared == 2


@jit_within
def _keeps_sides(fans: _Fans, vertices: _Vertices, u: int, v: int, to: _Candidate) -> bool:
    """Whether no triangle around the two turns over or becomes a sliver when they move."""
    p = (to[1], to[2], to[3])
    joined = _unit(_added(point_of(vertices.normals, u), point_of(vertices.normals, v)))
    for x in (u, v):
        y = u + v - x
        corner = fans.first[x]
        while corner >= 0:
            f = corner // 3
            g, h = int(fans.faces[f, (corner + 1) % 3]), int(fans.faces[f, (corner + 2) % 3])
            if fans.alive[f] and g != y and h != y and not _faces_right(vertices, p, x, g, h, joined):
                return False
            corner = fans.following[corner]
    return True


@jit_within
def _faces_right(vertices: _Vertices, p: Point, x: int, g: int, h: int, joined: Point) -> bool:
    """Whether the triangle of two vertices and a third that moves to ``p`` stays as it should."""
    a, b = point_of(vertices.points, g), point_of(vertices.points, h)
    normal, edges = _doubled(p, a, b)
    size = np.sqrt(dot(normal, normal))
    there = _added(joined, _added(_unit(point_of(vertices.normals, g)), _unit(point_of(vertices.normals, h))))
    if dot(normal, there) < _LEAST_COSINE * size * np.sqrt(dot(there, there)):
        return False
    if size >= _SLIVER * edges:
        return True
    old, old_edges = _doubled(point_of(vertices.points, x), a, b)
    return bool(size * old_edges >= np.sqrt(dot(old, old)) * edges)


@jit_within
def _doubled(a: Point, b: Point, c: Point) -> tuple[Point, float]:
    """Return the normal of a triangle, as long as twice its area, and the sum of its squared edges."""
    ab = (b[0] - a[0], b[1] - a[1], b[2] - a[2])
    ac = (c[0] - a[0], c[1] - a[1], c[2] - a[2])
    bc = (c[0] - b[0], c[1] - b[1], c[2] - b[2])
    normal = (
        ab[1] * ac[2] - ab[2] * ac[1],
        ab[2] * ac[0] - ab[0] * ac[2],
        ab[0] * ac[1] - ab[1] * ac[0],
    )
    return normal, dot(ab, ab) + dot(ac, ac) + dot(bc, bc)


@jit_within
def _added(a: Point, b: Point) -> Point:
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


@jit_within
def _unit(a: Point) -> Point:
    size = np.sqrt(dot(a, a)) + TINY
    return (a[0] / size, a[1] / size, a[2] / size)


@jit_within
def _merge(fans: _Fans, vertices: _Vertices, u: int, v: int, to: _Candidate) -> int:
    """Join ``u`` to ``v`` and return how many triangles that takes away."""
    gone = 0
    corner = fans.first[u]
    while corner >= 0:
        f = corner // 3
        if fans.alive[f]:
            if fans.faces[f, 0] == v or fans.faces[f, 1] == v or fans.faces[f, 2] == v:
                fans.alive[f] = False
                gone += 1
            else:
                fans.faces[f, corner % 3] = v
        corner = fans.following[corner]
    fans.following[fans.last[v]] = fans.first[u]
    for k in range(10):  # number by number: to add rows takes Numba 1.6 s more to compile
        vertices.quadrics[v, k] += vertices.quadrics[u, k]
    for k in range(3):
        vertices.normals[v, k] += vertices.normals[u, k]
    vertices.areas[v] += vertices.areas[u]
    vertices.points[v, 0], vertices.points[v, 1], vertices.points[v, 2] = to[1], to[2], to[3]
    vertices.on_line[v] = vertices.on_line[u] or vertices.on_line[v]
    vertices.changes[u] = -1
    vertices.changes[v] += 1
    _drop_dead(fans, v)
    return gone


@jit_within
def _drop_dead(fans: _Fans, v: int) -> None:
    """Keep only live triangles' corners in a vertex's list."""
    corner, first, last = fans.first[v], -1, -1
    while corner >= 0:
        if fans.alive[corner // 3]:
            if last < 0:
                first = corner
            else:
                fans.following[last] = corner
            last = corner
        corner = fans.following[corner]
    fans.following[last] = -1
    fans.first[v], fans.last[v] = first, last
