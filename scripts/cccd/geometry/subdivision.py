"""Catmull-Clark splines: closed control meshes of quads, creases, and the surfaces that they stand for.

The limit surface of Catmull and Clark 1978 is a bicubic B-spline wherever four quads meet, and has a
continuous tangent plane elsewhere. Subdivision is linear in the control points, so whatever is read off the
surface (points, normals, patches) is a sparse matrix times them; the limit's weights are those of Halstead,
Kass and DeRose 1993. Creases are semi-sharp after DeRose, Kass and Truong 1998, as OpenSubdiv and USD have
them: an edge of sharpness s is sharp for s steps of subdivision, one of `SHARP` for ever.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.sparse import coo_array, csr_array, diags_array, vstack

from cccd.geometry.arrays import FloatArray, IntArray, connected_parts, distinct
from cccd.geometry.mesh import Mesh

#: The mesh that is written has this many subdivisions: 32 triangles for each quad ...
DRAWN = 2
#: ... and one less (8 for each) where there are more quads than this: a cortex of 15,000 quads would be 6 %
#: farther from the truth for that.
LARGE = 20_000
#: An edge as sharp as this stays sharp however often it is subdivided (as in OpenSubdiv and USD).
SHARP = 10.0


@dataclass(frozen=True, eq=False)
class ControlMesh:
    """Control points and quads of a Catmull-Clark spline surface.

    Attributes
    ----------
    vertices : (V, 3) float64
        Control points, mostly in world mm (RAS).
    quads : (Q, 4) int64
        Counter-clockwise seen from outside.
    creases : (E, 2) int64
        Ends of the edges that are sharp.
    sharpness : (E,) float64
        How sharp each of them is; `SHARP` and more for ever.
    corners : (C,) int64
        Control points that the surface goes through; so it does wherever more than two creases meet.

    Examples
    --------
    A cube's limit surface is smooth and smaller than the cube; with all its edges sharp it is the cube.

    >>> corners = np.array([(x, y, z) for z in (-1.0, 1) for y in (-1.0, 1) for x in (-1.0, 1)])
    >>> sides = np.array([(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)])
    >>> round(ControlMesh(corners, sides).tessellate(3).volume, 2)
    2.58
    >>> edges, _ = quad_edges(sides)
    >>> round(ControlMesh(corners, sides, edges, np.full(12, SHARP)).tessellate(2).volume, 9)
    8.0
    """

    vertices: FloatArray
    quads: IntArray
    creases: IntArray = field(default_factory=lambda: np.zeros((0, 2), np.int64))
    sharpness: FloatArray = field(default_factory=lambda: np.zeros(0))
    corners: IntArray = field(default_factory=lambda: np.zeros(0, np.int64))
    _samplers: dict[int, Sampler] = field(default_factory=dict[int, "Sampler"], repr=False)

    def moved(self, vertices: FloatArray) -> ControlMesh:
        """Return the same quads and creases with other control points (V, 3)."""
        return replace(self, vertices=vertices)

    def sampler(self, times: int | None = None) -> Sampler:
        """Return the matrix from control points to the limit surface's points after some subdivisions.

        Without a number these are as many as the mesh that is written has.
        """
        if times is None:
            times = DRAWN - 1 if len(self.quads) > LARGE else DRAWN
        if times not in self._samplers:
            self._samplers[times] = Sampler.of(self, times)
        return self._samplers[times]

    def transformed(self, affine: FloatArray) -> ControlMesh:
        """Apply an affine (4, 4); quads keep their outer side, also when it mirrors."""
        vertices = self.vertices @ affine[:3, :3].T + affine[:3, 3]
        if np.linalg.det(affine[:3, :3]) > 0:
            return self.moved(vertices)
        quads = np.ascontiguousarray(self.quads[:, ::-1])
        mirrored = {times: sampler.mirrored() for times, sampler in self._samplers.items()}
        return replace(self, vertices=vertices, quads=quads, _samplers=mirrored)

    def rounded(self, tolerance: float) -> ControlMesh:
        """Round coordinates to a power of two, by at most ``tolerance``: bits that are zero pack well."""
        step = 2.0 ** math.floor(math.log2(2 * tolerance))
        return self.moved(np.round(self.vertices / step) * step + 0.0)  # no negative zeros

    def subdivided(self, times: int = 1) -> ControlMesh:
        """Return the control mesh of the same surface with four times the quads, ``times`` over."""
        mesh = self
        for _ in range(times):
            _, mesh = subdivide(mesh)
        return mesh

    def tessellate(self, times: int | None = None) -> Mesh:
        """Return triangles whose vertices lie on the limit surface, ``2 * 4**times`` for each quad.

        The first vertices are the limits of the control points. Without a number: the mesh that is written.
        """
        sampler = self.sampler(times)
        return Mesh(sampler.matrix @ self.vertices, sampler.triangles)

    def pieces(self) -> list[ControlMesh]:
        """Split into connected pieces, without unused control points, those with the lowest ones first."""
        ends, starts = self.quads.ravel(), np.roll(self.quads, 1, axis=1).ravel()
        piece = connected_parts(ends, starts, len(self.vertices))
        found: list[ControlMesh] = []
        for n in np.unique(piece[self.quads[:, 0]]):
            used, quads = distinct(self.quads[piece[self.quads[:, 0]] == n])
            mine = piece[self.creases[:, 0]] == n if len(self.creases) else np.zeros(0, np.bool_)
            creases = np.searchsorted(used, self.creases[mine])
            corners = np.flatnonzero(np.isin(used, self.corners))
            found.append(ControlMesh(self.vertices[used], quads, creases, self.sharpness[mine], corners))
        return found

    @cached_property
    def sign(self) -> int:
        """+1 where the surface encloses a solid, -1 where its outer side is within: a cavity."""
        return 1 if self.tessellate(1).volume > 0 else -1


@dataclass(frozen=True, eq=False)
class Sampler:
    """Points of the limit surface as a matrix of the control points.

    Attributes
    ----------
    matrix : (P, V) sparse
        Each row sums to one.
    triangles : (T, 3) int64
        Through the points, counter-clockwise seen from outside.
    """

    matrix: csr_array
    triangles: IntArray

    def mirrored(self) -> Sampler:
        """Return the same points with triangles that face the other way."""
        return Sampler(self.matrix, np.ascontiguousarray(self.triangles[:, ::-1]))

    @classmethod
    def of(cls, mesh: ControlMesh, times: int) -> Sampler:
        """Sample each quad at ``4**times`` times its share of the corners."""
        total: csr_array | None = None
        for _ in range(times):
            step, mesh = subdivide(mesh)
            total = step if total is None else csr_array(step @ total)
        points, quads = len(mesh.vertices), mesh.quads
        while np.any(mesh.sharpness < SHARP):  # the limit is known once no edge is sharp for some steps only
            step, mesh = subdivide(mesh)
            total = step if total is None else csr_array(step @ total)
        last = _limit_matrix(mesh)
        matrix = last if total is None else csr_array(last @ total)
        matrix = csr_array(matrix[:points])  # a step's vertices come first
        matrix.sort_indices()
        return cls(matrix, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]))


def quad_edges(quads: IntArray) -> tuple[IntArray, IntArray]:
    """Edges (E, 2) of quads (Q, n), the lower end first, and which edge (Q, n) each side is of.

    Side k runs from corner k to the next.
    """
    ends = np.sort(np.stack([quads, np.roll(quads, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    count = int(quads.max(initial=0)) + 1
    keys, side = np.unique(ends[:, 0] * count + ends[:, 1], return_inverse=True)
    return np.column_stack(np.divmod(keys, count)), side.reshape(quads.shape)


def subdivide(mesh: ControlMesh) -> tuple[csr_array, ControlMesh]:
    """Subdivide once by Catmull and Clark's rules.

    Returns
    -------
    matrix : (V', V) sparse
        New points from old ones: first those of the vertices, then of the edges, then of the quads.
    ControlMesh
        Four quads for each old one; the first corner of each is of an old vertex.
    """
    quads, count = mesh.quads, len(mesh.vertices)
    edges, side = quad_edges(quads)
    sharp = _sharpness_of_edges(edges, mesh)
    vertex, edge, face = _smooth_points(quads, edges, side, count)
    if len(mesh.creases) or len(mesh.corners):
        vertex, edge = _sharpened(vertex, edge, edges, sharp, mesh)
    on_edge, on_face = count + side, count + len(edges) + np.arange(len(quads))
    finer = [
        np.column_stack([quads[:, k], on_edge[:, k], on_face, on_edge[:, (k + 3) % 4]]) for k in range(4)
    ]
    kept = np.flatnonzero(sharp > 0)
    middles = count + kept
    halves = np.concatenate([np.column_stack([edges[kept, end], middles]) for end in (0, 1)])
    blunter = np.where(sharp[kept] >= SHARP, SHARP, np.maximum(sharp[kept] - 1, 0))
    still = np.tile(blunter > 0, 2)
    matrix = csr_array(vstack([vertex, edge, face]))
    creases, sharpness = halves[still], np.tile(blunter, 2)[still]
    return matrix, ControlMesh(
        matrix @ mesh.vertices, np.concatenate(finer), creases, sharpness, mesh.corners
    )


def _matrix(
    rows: IntArray, columns: IntArray, values: FloatArray | float, shape: tuple[int, int]
) -> csr_array:
    spread = np.broadcast_to(np.asarray(values, float), rows.shape)
    return coo_array((spread.ravel(), (rows.ravel(), columns.ravel())), shape=shape).tocsr()


def _smooth_points(
    quads: IntArray, edges: IntArray, side: IntArray, count: int
) -> tuple[csr_array, csr_array, csr_array]:
    """Matrices of the new points of vertices, edges and quads where nothing is sharp."""
    face_count, edge_count = len(quads), len(edges)
    of_quad = np.repeat(np.arange(face_count), 4).reshape(-1, 4)
    face = _matrix(of_quad, quads, 0.25, (face_count, count))
    beside = _matrix(side, of_quad, 0.25, (edge_count, face_count))
    ends = _matrix(np.repeat(np.arange(edge_count), 2).reshape(-1, 2), edges, 0.25, (edge_count, count))
    around = _matrix(quads, of_quad, 1.0, (count, face_count))
    both = np.concatenate([edges, edges[:, ::-1]])
    neighbours = _matrix(both[:, 0], both[:, 1], 1.0, (count, count))
    valence = np.maximum(np.bincount(quads.ravel(), minlength=count), 1).astype(float)
    vertex = diags_array(1 / valence**2) @ (around @ face + neighbours) + diags_array(1 - 2 / valence)
    return csr_array(vertex), csr_array(ends + beside @ face), face


def _sharpness_of_edges(edges: IntArray, mesh: ControlMesh) -> FloatArray:
    """How sharp (E,) each edge is."""
    sharp = np.zeros(len(edges))
    if len(mesh.creases):
        count = int(edges.max()) + 1
        ends = np.sort(mesh.creases, axis=1)
        keys = edges[:, 0] * count + edges[:, 1]
        sharp[np.searchsorted(keys, ends[:, 0] * count + ends[:, 1])] = mesh.sharpness
    return sharp


def _sharpened(
    vertex: csr_array, edge: csr_array, edges: IntArray, sharp: FloatArray, mesh: ControlMesh
) -> tuple[csr_array, csr_array]:
    """Points of vertices and edges, moved towards those of the sharp rules by how sharp they are."""
    share = np.minimum(sharp, 1.0)
    rows = np.repeat(np.arange(len(edges)), 2).reshape(-1, 2)
    middle = _matrix(rows, edges, 0.5, edge.shape)
    edge = csr_array(diags_array(1 - share) @ edge + diags_array(share) @ middle)
    rule, on_crease = _crease_rule(edges, sharp, mesh, (6.0, 1.0))
    vertex = csr_array(diags_array(1 - on_crease) @ vertex + diags_array(on_crease) @ rule)
    return vertex, edge


def _crease_rule(
    edges: IntArray, sharp: FloatArray, mesh: ControlMesh, weights: tuple[float, float]
) -> tuple[csr_array, FloatArray]:
    """Matrix (V, V) of the points along creases and at their corners, and how much of it counts (V,)."""
    # On a crease a vertex and its two neighbours along it have the weights; where other than two sharp edges
    # meet the vertex stays where it is, but at the end of a single one, which is smooth.
    kept, count = sharp > 0, len(mesh.vertices)
    ends = edges[kept]
    both = np.concatenate([ends, ends[:, ::-1]])
    number = np.bincount(ends.ravel(), minlength=count)
    total = np.bincount(ends.ravel(), np.repeat(np.minimum(sharp[kept], 1.0), 2), count)
    share = np.where(number >= 2, total / np.maximum(number, 1), 0.0)
    number[mesh.corners], share[mesh.corners] = 3, 1.0
    own, other = weights[0] / (weights[0] + 2 * weights[1]), weights[1] / (weights[0] + 2 * weights[1])
    along = number == 2
    links = _matrix(both[:, 0], both[:, 1], other * along[both[:, 0]], (count, count))
    return csr_array(links + diags_array(np.where(along, own, 1.0))), share


def _limit_matrix(mesh: ControlMesh) -> csr_array:
    """Matrix (V, V) of the places on the limit surface that the vertices go to."""
    quads, count = mesh.quads, len(mesh.vertices)
    valence = np.maximum(np.bincount(quads.ravel(), minlength=count), 1).astype(float)
    scale = 1 / (valence * (valence + 5))
    rows, columns, values = [np.arange(count)], [np.arange(count)], [valence / (valence + 5)]
    for k in range(4):
        for other, weight in ((1, 2.0), (3, 2.0), (2, 1.0)):
            rows.append(quads[:, k])
            columns.append(quads[:, (k + other) % 4])
            values.append(weight * scale[quads[:, k]])
    smooth = _matrix(np.concatenate(rows), np.concatenate(columns), np.concatenate(values), (count, count))
    if not len(mesh.creases) and not len(mesh.corners):
        return smooth
    edges, _ = quad_edges(quads)
    sharp = _sharpness_of_edges(edges, mesh)
    rule, share = _crease_rule(edges, np.where(sharp >= SHARP, sharp, 0.0), mesh, (4.0, 1.0))
    return csr_array(diags_array(1 - share) @ smooth + diags_array(share) @ rule)
