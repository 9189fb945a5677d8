"""One Catmull-Clark spline through a complex of walls: a patch for each, seams as creases for ever.

Control points on seams are those of the walls on all their sides, so neighbours meet exactly. They are fitted
first, to the seams as curves; then those within the walls move along the normals until the walls lie on those
of the complex, by plain least squares as where an organ is alone (`cccd.surface.spline`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from operator import itemgetter

import numpy as np
from scipy.sparse import coo_array, csr_array, diags_array, eye_array
from scipy.sparse.linalg import splu
from scipy.spatial import cKDTree

from cccd.geometry.arrays import BoolArray, FloatArray, IntArray, connected_parts
from cccd.geometry.decimation import CORNER, WITHIN, weigh_more
from cccd.geometry.distance import nearest_faces
from cccd.geometry.mesh import Mesh
from cccd.geometry.subdivision import SHARP, ControlMesh, quad_edges
from cccd.surface.control_mesh import join_in_pairs, split_to_quads
from cccd.surface.spline import ROUNDS, SAMPLED, SplineFit, Target, neighbour_means
from cccd.surface.surface import LoftedSurface
from cccd_walls.complexes import WallComplex

#: The first spline has one triangle for so many of the complex, and the last at most one for so many.
COARSEST, COARSER = 100, 4
#: Triangles that are chosen from: so many times those that are left.
SPARE = 8
#: Rounds in which triangles become as many as the spline is times too far off there.
REFINEMENTS = 3
#: Where the spline passes through itself a triangle becomes so many.
AMISS_SPLIT = 4.0
#: Share of the tolerance that is asked of what is made finer.
NEARER = 0.4
#: An organ is near where at most this share of it is farther off than the tolerance; half the tolerance while
#: quads are chosen, as what is smoothed where it crosses, and what the spline leaves out, are not seen then.
FAR, NEAR = 0.01, 0.5
#: Of walls' distances 99 % are below so many times their root mean square, about.
TAIL = 2.6
#: Weight of even control points along a seam beside near ones.
EVENNESS = 1e-2
#: The spline is fitted to planes at vertices, so triangles are split until they are about as short as so many
#: tolerances, or until there are so many.
EDGE_TOLERANCES, SPLIT_TO = 2.0, 400_000
#: mm: vertices of seams are found again within this distance.
SAME = 1e-6


@dataclass(frozen=True, eq=False)
class WallSpline:
    """A spline through walls.

    Attributes
    ----------
    control : ControlMesh
        In mm, as the walls that it is fitted to.
    wall : (Q,) int64
        Of each quad.
    regions : (W, 2) int64
        As of `WallComplex`.
    crossing : int
        Pairs of triangles of it that pass through each other.
    organs : sequence of str
        Names of the regions from 1.
    """

    control: ControlMesh
    wall: IntArray
    regions: IntArray
    crossing: int
    organs: Sequence[str] = ()


def fit_organs(surfaces: Mapping[str, LoftedSurface], tolerance: float) -> WallSpline:
    """Fit a spline to the walls of those organs of a case that have a mesh and no spline.

    Parameters
    ----------
    surfaces : mapping of str to LoftedSurface
        By organ, in mm RAS. Neighbours that share a wall have the same vertices and triangles there.
    tolerance : float
        See `fit_walls`.

    Returns
    -------
    WallSpline
        In mm RAS; without a wall where there are not two such organs.
    """
    joint = [name for name, one in surfaces.items() if not one.bodies and one.mesh.is_closed_manifold]
    if len(joint) < 2:
        none = np.zeros(0, np.int64)
        return WallSpline(ControlMesh(np.zeros((0, 3)), none.reshape(-1, 4)), none, none.reshape(-1, 2), 0)
    frame = surfaces[joint[0]].frame
    walls = WallComplex.welded([surfaces[name].mesh for name in joint], frame)
    spline = fit_walls(walls.without_specks(float(frame.spacing.prod())), tolerance)
    control = spline.control.transformed(frame.plane_to_world(np.zeros(2)))
    return replace(spline, control=control, organs=joint)


def fit_walls(walls: WallComplex, tolerance: float) -> WallSpline:
    """Fit a spline to walls, with quads as fine as it takes.

    Parameters
    ----------
    walls : WallComplex
    tolerance : float
        99 % of the spline shall lie within so many mm of the walls.

    Returns
    -------
    WallSpline
        Of triangles that became three quads or two each, at most a quarter of the walls'.
    """
    target, size = _split(walls, tolerance), len(walls.triangles)
    most = max(size // COARSEST, 1)
    fine = walls.collapsed(SPARE * most)
    weights = np.ones(len(fine.vertices))
    found = list[tuple[int, int, WallFit]]()
    for attempt in range(1 + REFINEMENTS):
        coarse = fine.collapsed(most, weights)
        fit = _fitted(coarse, walls, target)
        times = _too_coarse(fit, coarse, tolerance)
        if times.max() == 1 or attempt >= REFINEMENTS - 1:
            crossing = len(fit.untangle())
            far = int(np.count_nonzero(fit.far_walls(*fit.off(), walls.regions, tolerance)))
            found.append((far, crossing, fit))
            if times.max() == 1 or not far + crossing:
                break
        most = min(round(float(times.sum())), size // COARSER + 1)
        if SPARE * most > len(fine.triangles):
            before, fine = fine, walls.collapsed(SPARE * most)
            weights = weights[cKDTree(before.vertices).query(fine.vertices)[1]]
        weigh_more(weights, fine.mesh, coarse.mesh, times)
    _, crossing, fit = min(found, key=itemgetter(0, 1))
    return WallSpline(fit.spline, fit.walls_of_quads, walls.regions, crossing)


def _too_coarse(fit: WallFit, coarse: WallComplex, tolerance: float) -> FloatArray:
    """How many triangles each triangle (T,) shall become; all 1 where each organ is near and none crosses."""
    places, off = fit.off()
    shape, count = coarse.mesh, len(coarse.triangles)
    near = nearest_faces(places, shape)
    mean = np.bincount(near, off**2, count) / np.maximum(np.bincount(near, minlength=count), 1)
    times = np.clip(TAIL * np.sqrt(mean) / (NEARER * tolerance), 1.0, COARSEST / COARSER)
    times[~fit.far_walls(places, off, coarse.regions, NEAR * tolerance)[coarse.wall]] = 1.0
    drawn = fit.spline.tessellate(1)
    crossing = drawn.self_intersections()
    there = np.zeros(count, np.bool_)
    there[nearest_faces(drawn.vertices[drawn.faces[crossing.ravel(), 0]], shape)] = True
    return np.where(there, np.maximum(times, AMISS_SPLIT), times)


def _split(walls: WallComplex, tolerance: float) -> WallTarget:
    """Take walls as a target, their triangles split until they are short."""
    mesh, _, wall = walls.apart
    while len(mesh.faces) < SPLIT_TO and _mean_edge(mesh) > EDGE_TOLERANCES * tolerance:
        count = len(mesh.vertices)
        edges, side = quad_edges(mesh.faces)
        (a, b, c), (ab, bc, ca) = mesh.faces.T, (count + side).T
        quarters = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
        vertices = np.concatenate([mesh.vertices, mesh.vertices[edges].mean(axis=1)])
        mesh = Mesh(vertices, np.concatenate([np.column_stack(corners) for corners in quarters]))
        wall = np.concatenate([wall, wall[edges[:, 0]]])
    return WallTarget.of_walls(mesh, wall)


def _mean_edge(mesh: Mesh) -> float:
    ends = mesh.vertices[mesh.faces]
    return float(np.linalg.norm(ends - np.roll(ends, 1, axis=1), axis=2).mean())


@dataclass(frozen=True, eq=False)
class WallTarget(Target):
    """A mesh of walls that share no vertices; samples of a wall look for their own alone.

    Attributes
    ----------
    apart : float
        Walls are so far apart along the fourth coordinate of the tree.
    """

    apart: float = 0.0

    @classmethod
    def of_walls(cls, mesh: Mesh, wall: IntArray) -> WallTarget:
        """Take a mesh whose vertices (V,) are each of one wall."""
        apart = 10 * float(np.ptp(mesh.vertices, axis=0).max())
        return cls(mesh, cKDTree(np.column_stack([mesh.vertices, apart * wall])), apart)


class WallFit(SplineFit):
    """A spline on its way to walls; its seams stay."""

    #: More evening out would take thin walls far from where they are.
    rounds = (6, 8, 12)
    #: As finely as patches of solids are looked at.
    drawn = 2

    def __init__(
        self, control: ControlMesh, wall: IntArray, seams: tuple[IntArray, FloatArray], target: WallTarget
    ) -> None:
        super().__init__(control, target)
        self.walls_of_quads = wall
        finer, self._wall = control.subdivided(SAMPLED), np.zeros(len(self.rim), np.int64)
        self._wall[finer.quads] = np.tile(wall, 4**SAMPLED)[:, None]
        self.rim[finer.creases] = True
        count = len(self.points)
        self.neighbours = neighbour_means(self.edges, control, self.rim[:count])
        self._seams = seams
        if len(seams[0]):
            self._place_seams(*seams)

    def _place_seams(self, samples: IntArray, goals: FloatArray) -> None:
        """Fit control points on seams to places (P, 3) of samples (P,) of them; corners stay."""
        count = len(self.points)
        free = np.flatnonzero(self.rim[:count])
        free = np.setdiff1d(free, self.wall.corners)
        rows = csr_array(self.sampling[samples])
        uneven = csr_array(eye_array(count) - self.neighbours)[free]
        seen, bent = csr_array(rows[:, free]), csr_array(uneven[:, free])
        missing = seen.T @ (goals - rows @ self.points) - EVENNESS * (bent.T @ (uneven @ self.points))
        system = csr_array(seen.T @ seen + EVENNESS * (bent.T @ bent)).tocsc()
        self.points[free] += splu(system).solve(missing)

    def off(self) -> tuple[FloatArray, FloatArray]:
        """Places (P, 3) on the walls, and how many mm (P,) each is off; on seams from where it shall be."""
        places, off = super().off()
        samples, goals = self._seams
        off[samples] = np.linalg.norm(places[samples] - goals, axis=1)
        return places, off

    def far_walls(
        self, places: FloatArray, off: FloatArray, regions: IntArray, tolerance: float
    ) -> BoolArray:
        """Which walls (W,), of regions (W, 2), are of an organ that is not near by what `off` gives."""
        area = Mesh(places, self.triangles).vertex_areas
        organs = regions[self._wall]
        whole, far = (
            np.bincount(organs.ravel(), np.repeat(part, 2)) for part in (area, area * (off > tolerance))
        )
        return np.any((far > FAR * whole)[regions] & (regions > 0), axis=1)

    def _away(self, samples: FloatArray, normals: FloatArray) -> tuple[FloatArray, BoolArray]:
        assert isinstance(self.target, WallTarget)
        placed = np.column_stack([samples, self.target.apart * self._wall])
        return self.target.away(np.asarray(placed, float), normals)

    def _normals(self, samples: FloatArray) -> FloatArray:
        normals = Mesh(samples, self.triangles).vertex_normals.copy()
        normals[self.rim] = 0
        return normals

    def _even(self, along: FloatArray) -> None:
        before = self.points
        super()._even(along)
        rim = self.rim[: len(before)]
        self.points[rim] = before[rim]


def _fitted(coarse: WallComplex, walls: WallComplex, target: WallTarget) -> WallFit:
    """Fit a spline with the quads of a coarse complex to walls."""
    control, wall, middles = _control(coarse)
    fit = WallFit(control, wall, _seam_goals(control, middles, coarse, walls), target)
    for _ in range(ROUNDS):
        fit.step()
    return fit


def _control(coarse: WallComplex) -> tuple[ControlMesh, IntArray, IntArray]:
    """Split triangles to quads; also gives the walls (Q,) of these, and the middles (E,) of seams' edges."""
    mesh, vertex, wall = coarse.apart
    quads, triangles = join_in_pairs(mesh)
    points, finer, split = split_to_quads(coarse.vertices, vertex[quads], vertex[triangles])
    count, seams = len(coarse.vertices), coarse.seams.ends
    middles = count + np.searchsorted(split @ [count, 1], seams @ [count, 1])
    halves = np.concatenate([np.column_stack([seams[:, end], middles]) for end in (0, 1)])
    corners = np.flatnonzero(coarse.seams.kinds == CORNER)
    walls = np.concatenate([np.tile(wall[quads[:, 0]], 4), np.tile(wall[triangles[:, 0]], 3)])
    return ControlMesh(points, finer, halves, np.full(len(halves), SHARP), corners), walls, middles


def _seam_goals(
    control: ControlMesh, middles: IntArray, coarse: WallComplex, walls: WallComplex
) -> tuple[IntArray, FloatArray]:
    """Where samples (P,) of a spline on seams shall lie (P, 3)."""
    seams = coarse.seams.ends
    count = len(control.vertices)
    edges, _ = quad_edges(control.quads)
    quarters = [
        count + np.searchsorted(edges @ [count, 1], np.column_stack([seams[:, end], middles]) @ [count, 1])
        for end in (0, 1)
    ]
    if not len(seams):
        return np.zeros(0, np.int64), np.zeros((0, 3))
    places = _along_seams(coarse, walls, np.array([0.25, 0.5, 0.75]))
    ends = np.flatnonzero(coarse.seams.kinds > WITHIN)
    samples = np.concatenate([ends, quarters[0], middles, quarters[1]])
    return samples, np.concatenate([coarse.vertices[ends], *places])


def _along_seams(coarse: WallComplex, walls: WallComplex, shares: FloatArray) -> FloatArray:
    """Points (S, E, 3) of walls at shares (S,) of the length of each edge that their seams collapsed to."""
    few, many = (each.seams.ends for each in (coarse, walls))
    kept, count = np.unique(few), len(walls.vertices)
    candidates = np.unique(many)
    number = np.full(count, -1)  # of coarse vertices
    number[candidates[cKDTree(walls.vertices[candidates]).query(coarse.vertices[kept])[1]]] = kept
    inner = number[many] < 0
    one, other = many[inner.all(axis=1)].T
    part = connected_parts(one, other, count)
    # what runs between two vertices that were kept is a part; at each of its ends is an edge to one of them
    last = np.flatnonzero(inner.sum(axis=1) == 1)
    within, end = np.where(inner[last, :1], many[last], many[last, ::-1]).T
    order = np.lexsort((number[end], part[within]))
    within, end, last = within[order], number[end[order]], last[order]
    keys = few @ [len(coarse.vertices), 1]
    edge_of = np.full(count, -1)
    edge_of[part[within[::2]]] = np.searchsorted(keys, end.reshape(-1, 2) @ [len(coarse.vertices), 1])
    vertices, found = _shares_of_length(walls, many, inner, within[1::2], last[1::2])
    at = edge_of[part[vertices]] + np.clip(found, SAME, 1 - SAME)
    whole = np.arange(len(few))
    at = np.concatenate([whole, at, whole + 1 - SAME / 2])
    order = np.argsort(at, kind="stable")
    points = np.concatenate(
        [coarse.vertices[few[:, 0]], walls.vertices[vertices], coarse.vertices[few[:, 1]]]
    )
    wanted = whole + shares[:, None]
    return np.stack([np.interp(wanted, at[order], axis[order]) for axis in points.T], axis=-1)


def _shares_of_length(
    walls: WallComplex, seams: IntArray, inner: BoolArray, within: IntArray, last: IntArray
) -> tuple[IntArray, FloatArray]:
    """At which share (N,) of the length of its part of a seam each vertex (N,) stands.

    ``inner`` (E, 2) says which ends of seams' edges (E, 2) are within parts, ``last`` (P,) are the edges at
    which these have the share 1, and ``within`` (P,) the vertices there. Shares of the length are harmonic.
    """
    count, both = len(walls.vertices), inner.all(axis=1)
    vertices = np.flatnonzero(np.bincount(seams[inner], minlength=count))
    if not len(vertices):
        return vertices, np.zeros(0)
    place = np.full(count, -1)
    place[vertices] = np.arange(len(vertices))
    length = np.linalg.norm(walls.vertices[seams[:, 0]] - walls.vertices[seams[:, 1]], axis=1)
    stiff = 1 / np.maximum(length, SAME)
    rows, columns = place[seams[both]].T
    size = len(vertices)
    links = coo_array((stiff[both], (rows, columns)), shape=(size, size)).tocsr()
    total = np.bincount(place[seams[inner]], np.column_stack([stiff, stiff])[inner], size)
    right = np.bincount(place[within], stiff[last], size)
    return vertices, splu(csr_array(diags_array(total) - links - links.T).tocsc()).solve(right)
