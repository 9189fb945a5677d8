"""Bicubic Bezier patches of a Catmull-Clark spline: its own where it is regular, next to them elsewhere.

Where four quads meet at each corner of a quad, its patch is the limit surface. Around other corners the
limit surface has no polynomial patch; there corners and tangent planes are those of the limit surface, as in
Loop, Schaefer, Ni and Castano 2009, and the inner control points are moved along the normals until the
normals on both sides of the edges agree as well as they can. Neighbours share the points of their edges, so
the patches are closed by construction. Along a crease they end in the crease's cubic spline.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.sparse import coo_array, csr_array, eye_array
from scipy.sparse.linalg import spsolve

from cccd.geometry.arrays import BoolArray, FloatArray, IntArray, unit_vectors
from cccd.geometry.subdivision import SHARP, ControlMesh, Sampler, quad_edges
from cccd.tolerances import TINY

#: Where, along an edge, the normals of its two patches shall agree.
AGREEING_AT = np.linspace(0, 1, 7)[1:-1]
#: What it costs to move inner points: one radian of a jump weighs as much as a move by so many chords.
STIFFNESS = 0.4


@dataclass(frozen=True, eq=False)
class HalfEdges:
    """Who is beside whom among quads: half-edge ``4 q + k`` runs from corner k of quad q to the next one.

    Attributes
    ----------
    origin : (4 Q,) int64
        The vertex that it begins at.
    twin : (4 Q,) int64
        The same edge in the quad beside it.
    around : (4 Q,) int64
        The next one counter-clockwise about its origin.
    back : (4 Q,) int64
        The next one clockwise.
    sharp : (4 Q,) bool
        Whether it lies on a crease.
    creases : (4 Q,) int64
        How many creases meet where it begins; three and more at every point that the surface goes through.
    """

    origin: IntArray
    twin: IntArray
    around: IntArray
    back: IntArray
    sharp: BoolArray
    creases: IntArray

    @classmethod
    def of(cls, mesh: ControlMesh) -> HalfEdges:
        """Find them in a closed mesh."""
        edges, side = quad_edges(mesh.quads)
        pairs = np.argsort(side.ravel(), kind="stable").reshape(-1, 2)
        twin = np.empty(4 * len(mesh.quads), np.int64)
        twin[pairs], own = pairs[:, ::-1], np.arange(len(twin))
        around = twin[own - own % 4 + (own + 3) % 4]
        back = np.empty_like(around)
        back[around] = own
        count = len(mesh.vertices)
        ends = np.sort(mesh.creases, axis=1)
        creased = np.isin(edges[:, 0] * count + edges[:, 1], ends[:, 0] * count + ends[:, 1])
        number = np.bincount(edges[creased].ravel(), minlength=count)
        number[mesh.corners] += 3
        origin = mesh.quads.ravel()
        return cls(origin, twin, around, back, creased[side.ravel()], number[origin])

    @cached_property
    def following(self) -> IntArray:
        """The next one (4 Q,) around the quad."""
        own = np.arange(len(self.twin))
        return own - own % 4 + (own + 1) % 4

    @cached_property
    def valence(self) -> IntArray:
        """How many begin at the same vertex (4 Q,)."""
        return np.bincount(self.origin)[self.origin]

    @cached_property
    def sector(self) -> tuple[IntArray, IntArray]:
        """Quads between it and the crease before it (4 Q,), and to the one after it; the valence without."""
        return self._steps(self.back, False), self._steps(self.around, True)

    def _steps(self, turn: IntArray, onwards: bool) -> IntArray:
        own = np.arange(len(self.twin))
        found, at = self.valence.copy(), turn[own] if onwards else own
        for step in range(int(onwards), int(self.valence.max()) + 1):
            found = np.where(self.sharp[at] & (found == self.valence), np.minimum(step, found), found)
            at = turn[at]
        return found

    @cached_property
    def regular(self) -> BoolArray:
        """Whether the surface around its origin is a bicubic spline (4 Q,), on its side of a crease."""
        smooth = (self.creases < 2) & (self.valence == 4)
        return smooth & (self.creases == 0) | (self.creases == 2) & (sum(self.sector) == 2)


def settled(mesh: ControlMesh) -> ControlMesh:
    """Subdivide until no edge is sharp for some steps only: what is left of creases is sharp for ever."""
    while np.any(mesh.sharpness < SHARP):
        mesh = mesh.subdivided()
    return mesh


def bernstein(at: FloatArray, derivative: bool = False) -> FloatArray:
    """Cubic Bernstein polynomials (N, 4), or their derivatives, at parameters (N,)."""
    t, s = at, 1 - at
    if derivative:
        return 3 * np.stack([-s * s, s * s - 2 * s * t, 2 * s * t - t * t, t * t], axis=-1)
    return np.stack([s**3, 3 * s * s * t, 3 * s * t * t, t**3], axis=-1)


@dataclass(frozen=True, eq=False)
class LimitPatches:
    """A bicubic Bezier patch for each quad of a control mesh.

    Attributes
    ----------
    links : HalfEdges
    corners : (V, 3) float64
        Points on the limit surface.
    along : (4 Q, 3) float64
        Control point of each half-edge beside its origin.
    inner : (4 Q, 3) float64
        Inner control point of its quad beside its origin.

    Examples
    --------
    >>> corners = np.array([(x, y, z) for z in (-1.0, 1) for y in (-1.0, 1) for x in (-1.0, 1)])
    >>> sides = np.array([(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)])
    >>> ball = LimitPatches.of(ControlMesh(corners, sides))
    >>> ball.nets.shape, round(float(ball.jumps().max()), 1), round(float(ball.eased().jumps().max()), 1)
    ((6, 4, 4, 3), 14.7, 2.0)
    """

    links: HalfEdges
    corners: FloatArray
    along: FloatArray
    inner: FloatArray

    @classmethod
    def of(cls, mesh: ControlMesh) -> LimitPatches:
        """Find the patches of a closed mesh none of whose edges is sharp for some steps only."""
        links = HalfEdges.of(mesh)
        corners = Sampler.of(mesh, 0).matrix @ mesh.vertices
        inner = _inner(mesh, links)
        along = np.where((links.creases < 2)[:, None], _along_smooth(mesh, links, corners), 0.0)
        creased = links.creases >= 2
        along[creased] = _along_creased(mesh, links, corners, inner)[creased]
        ends = mesh.vertices[links.origin], mesh.vertices[links.origin[links.twin]]
        along = np.where(links.sharp[:, None], (2 * ends[0] + ends[1]) / 3, along)
        return cls(links, corners, along, inner)

    @cached_property
    def nets(self) -> FloatArray:
        """Control points (Q, 4, 4, 3): on the first axis from corner 0 to 3, on the second from 0 to 1."""
        count = len(self.inner) // 4
        nets = np.empty((count, 4, 4, 3))
        own = np.arange(4 * count).reshape(-1, 4)
        for k in range(4):
            turned = np.rot90(nets, k, axes=(1, 2))  # a view in which corner k comes first
            turned[:, 0, 0] = self.corners[self.links.origin[own[:, k]]]
            turned[:, 0, 1] = self.along[own[:, k]]
            turned[:, 1, 0] = self.along[self.links.around[own[:, k]]]
            turned[:, 1, 1] = self.inner[own[:, k]]
        return nets

    def samples(self, count: int) -> FloatArray:
        """Return points (Q, count, count, 3) on the patches."""
        at = bernstein(np.linspace(0, 1, count))
        return np.einsum("ia,qabc,jb->qijc", at, self.nets, at, optimize=True)

    def jumps(self, count: int = 17, of: BoolArray | None = None) -> FloatArray:
        """Degrees (E, count) between the normals of both patches along each edge that is no crease.

        They are taken in the middles of equal parts: at corners where two quads meet patches have no normal.
        ``of`` (4 Q,) says which half-edges to look at; all by default.
        """
        kept = self._both_ways if of is None else self._both_ways[of[self._both_ways]]
        return np.degrees(np.abs(self._folds(kept, (np.arange(count) + 0.5) / count).angle))

    @cached_property
    def _both_ways(self) -> IntArray:
        """One half-edge of each edge that is no crease."""
        own = np.arange(len(self.inner))
        return own[(own < self.links.twin) & ~self.links.sharp]

    def _folds(self, of: IntArray, at: FloatArray) -> _Folds:
        sides = [np.rot90(self.nets, k, axes=(1, 2))[:, :2] for k in range(4)]
        rows = np.stack(sides, axis=1).reshape(-1, 2, 4, 3)
        first, second = _side(rows[of], at), _side(rows[self.links.twin[of]], at)
        second = tuple(part[:, ::-1] for part in second)
        angle = np.arctan2(
            np.einsum("etc,etc->et", np.cross(first[0], second[0]), first[2]),
            np.einsum("etc,etc->et", first[0], second[0]),
        )
        return _Folds(angle, unit_vectors(first[0] + second[0]), first[1], second[1])

    def eased(self) -> LimitPatches:
        """Move inner points beside irregular corners along the normals: jumps over edges get small."""
        free = np.flatnonzero(~self.links.regular)
        if len(free) == 0:
            return self
        folds = self._folds(self._both_ways, AGREEING_AT)
        chord = self._chords
        system = csr_array(self._rises(folds)[:, free] * chord[free])
        normal = csr_array(system.T @ system + STIFFNESS**2 * eye_array(len(free)))
        move = np.asarray(spsolve(normal.tocsc(), system.T @ folds.angle.ravel()))
        inner = self.inner.copy()
        inner[free] += (move * chord[free])[:, None] * self._normals[free]
        return replace(self, inner=inner)

    def _rises(self, folds: _Folds) -> csr_array:
        """By how much each angle of folds closes when an inner point (4 Q,) moves out by one mm."""
        half, following = self._both_ways, self.links.following
        twin = self.links.twin[half]
        _, beside, far, _ = 3 * bernstein(AGREEING_AT).T
        slopes = [
            np.einsum("etc,ec->et", folds.normal, self._normals[point]) * weight / np.maximum(width, TINY)
            for point, weight, width in (
                (half, beside, folds.width),
                (following[half], far, folds.width),
                (twin, far, folds.width_beyond),
                (following[twin], beside, folds.width_beyond),
            )
        ]
        rows = np.arange(folds.angle.size).reshape(folds.angle.shape)
        points = np.stack([half, following[half], twin, following[twin]])
        places = np.broadcast_to(rows, (4, *rows.shape)), np.broadcast_to(points[..., None], (4, *rows.shape))
        shape = (rows.size, len(self.inner))
        return csr_array(coo_array((np.ravel(slopes), (places[0].ravel(), places[1].ravel())), shape=shape))

    @cached_property
    def _chords(self) -> FloatArray:
        """How far in mm (4 Q,) the points along both edges are from a corner."""
        away = np.linalg.norm(self.along - self.corners[self.links.origin], axis=1)
        return (away + away[self.links.around]) / 2

    @cached_property
    def _normals(self) -> FloatArray:
        """Unit normals (4 Q, 3) of each quad's patch at its corners."""
        start = self.corners[self.links.origin]
        return unit_vectors(np.cross(self.along - start, self.along[self.links.around] - start))

    def rounded(self, step: float, kept: BoolArray) -> LimitPatches:
        """Round control points so that few digits do, and patches that join smoothly still do.

        Where the surface is regular the other points are means of inner ones, so those are rounded to four
        steps and the others follow; the ends (V,) of ``kept`` and what lies on an edge between two stay.
        """
        links = self.links
        inner = np.round(self.inner / (4 * step)) * (4 * step)
        means = (inner + inner[links.back]) / 2
        fixed = kept[links.origin] & kept[links.origin[links.twin]] & links.sharp
        along = np.where((links.regular & ~links.sharp)[:, None], means, _round(self.along, 2 * step))
        along = np.where(fixed[:, None], self.along, along)
        corners = np.where(kept[:, None], self.corners, _round(self.corners, step))
        opposite = links.around[links.around]
        follows = links.regular & (links.valence == 4) & ~kept[links.origin]
        follows &= (links.creases == 0) | (links.sharp & links.sharp[opposite])
        corners[links.origin[follows]] = ((along + along[opposite]) / 2)[follows]
        return replace(self, corners=corners, along=along, inner=inner)


@dataclass(frozen=True, eq=False)
class _Folds:
    """Signed angles (E, N) in radians by which patches fold along edges, and mean normals (E, N, 3).

    A width (E, N) is how fast a patch leaves its edge, in mm for one of its parameter.
    """

    angle: FloatArray
    normal: FloatArray
    width: FloatArray
    width_beyond: FloatArray


def _round(points: FloatArray, step: float) -> FloatArray:
    return np.round(points / step) * step


def _side(rows: FloatArray, at: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Find normals (E, N, 3) along the first of two rows (E, 2, 4, 3) of control points, widths, tangents."""
    tangent = unit_vectors(np.asarray(np.einsum("ta,eac->etc", bernstein(at, True), rows[:, 0]), np.float64))
    into = 3 * np.asarray(np.einsum("ta,eac->etc", bernstein(at), rows[:, 1] - rows[:, 0]), np.float64)
    into -= np.einsum("etc,etc->et", into, tangent)[..., None] * tangent
    normal = unit_vectors(np.asarray(np.cross(tangent, into), np.float64))
    return normal, np.linalg.norm(into, axis=2), tangent


def _inner(mesh: ControlMesh, links: HalfEdges) -> FloatArray:
    """Inner control points (4 Q, 3): the formula of the regular quad, with the corner's valence."""
    points = mesh.vertices[mesh.quads]
    own, following, across, before = (np.roll(points, -k, axis=1).reshape(-1, 3) for k in range(4))
    mirrored = np.where(links.creases == 2, np.maximum(2 * sum(links.sector), 4), 4)
    weight = np.where(links.creases < 2, links.valence, mirrored)[:, None].astype(float)
    return (weight * own + 2 * following + 2 * before + across) / (weight + 5)


def _along_smooth(mesh: ControlMesh, links: HalfEdges, corners: FloatArray) -> FloatArray:
    """Points (4 Q, 3) beside corners in the limit's tangent planes, by the masks of its derivatives."""
    n = links.valence
    cosine = np.cos(np.pi / n)
    tilt = 1 / np.sqrt(4 + cosine**2)
    double = np.cos(2 * np.pi / n)
    shrinking = (5 + double + cosine * np.sqrt(18 + 2 * double)) / 16
    middles = (mesh.vertices[links.origin] + mesh.vertices[links.origin[links.twin]]) / 2
    centres = np.repeat(mesh.vertices[mesh.quads].mean(axis=1), 4, axis=0)
    tangent, at = np.zeros((len(n), 3)), np.arange(len(n))
    for j in range(int(n.max())):
        on_edge = (1 - tilt * cosine) * np.cos(2 * np.pi * j / n) * (j < n)
        on_quad = 2 * tilt * np.cos((2 * np.pi * j + np.pi) / n) * (j < n)
        tangent += on_edge[:, None] * middles[at] + on_quad[:, None] * centres[at]
        at = links.around[at]
    return corners[links.origin] + (4 / 3 * shrinking / n)[:, None] * tangent


def _along_creased(mesh: ControlMesh, links: HalfEdges, corners: FloatArray, inner: FloatArray) -> FloatArray:
    """Points (4 Q, 3) on edges beside a crease: between inner ones, in the tangent plane of their side."""
    means = (inner + inner[links.back]) / 2
    if not links.sharp.any():
        return means
    before, after = links.sector
    count = before + after
    plane = unit_vectors(_normal_of_sector(mesh, links))
    height = np.einsum("hc,hc->h", means - corners[links.origin], plane)
    bent = (links.creases == 2) & (count > 2) & ~links.sharp
    return means - np.where(bent, height, 0.0)[:, None] * plane


def _normal_of_sector(mesh: ControlMesh, links: HalfEdges) -> FloatArray:
    """Find normals (4 Q, 3), of any length, of the limit on the side of a crease that a half-edge is on."""
    # One derivative is along the crease, the other is what is left of the differences across it in the end.
    creased = links.creases == 2
    before, after = (np.where(creased, steps, 1) for steps in links.sector)
    first, count = np.arange(len(before)), before + after
    for step in range(int(before.max())):
        first = np.where(creased & (before > step), links.back[first], first)
    angle = np.pi / np.maximum(count, 2)  # a single quad has no edge within
    on_origin, on_crease, on_edges = _weights_across(angle)
    ends = mesh.vertices[links.origin[links.twin]]
    opposite = np.roll(mesh.vertices[mesh.quads], -2, axis=1).reshape(-1, 3)
    across = on_origin[:, None] * mesh.vertices[links.origin] + on_crease[:, None] * ends[first]
    at = first
    for step in range(int(count.max())):
        here, next_ = np.sin(step * angle), np.sin((step + 1) * angle)
        part = (on_edges * here)[:, None] * ends[at] + (here + next_)[:, None] * opposite[at]
        across += np.where((step < count)[:, None], part, 0.0)
        at = np.where(step < count, links.around[at], at)
    across += on_crease[:, None] * ends[at]
    return np.cross(ends[first] - ends[at], across)


def _weights_across(angle: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Weights of what lies across a crease, for quads of an angle: origin, crease's ends, edges by sine."""
    # They make up the left eigenvector of one step of subdivision in which edges weigh as the sine of their
    # angle; quads weigh as the sum of the sines beside them.
    cosine = np.cos(angle)
    half, product = (5 + cosine) / 16, (3 + cosine) / 32 - (1 + cosine) / 32
    eigenvalue = half + np.sqrt(half**2 - product)
    on_edges = 16 * eigenvalue - 4
    sines = (3 * on_edges / 8 + 0.5) / np.tan(angle / 2)
    beside = np.sin(angle) * eigenvalue
    on_origin = (beside + (eigenvalue - 0.5) * sines) / ((eigenvalue - 0.5) * (eigenvalue - 0.75) - 0.125)
    return on_origin, (eigenvalue - 0.75) * on_origin - sines, on_edges
