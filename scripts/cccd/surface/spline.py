"""One closed spline through a stack of slices: control mesh, fit, repair of what passes through itself.

A Catmull-Clark spline is fitted by plain least squares: control points move along the surface's normals until
samples of the limit surface lie on the mesh; along the surface they only even out.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import Any

import numpy as np
from scipy.sparse import coo_array, csr_array, diags_array
from scipy.sparse.linalg import LinearOperator, cg
from scipy.spatial import cKDTree

from cccd.containers import Frame
from cccd.geometry.arrays import BoolArray, FloatArray, IntArray, unit_vectors
from cccd.geometry.collisions import MovingTriangles
from cccd.geometry.decimation import ahead, weigh_more
from cccd.geometry.distance import nearest_faces
from cccd.geometry.mesh import Mesh
from cccd.geometry.subdivision import ControlMesh, Sampler, quad_edges
from cccd.surface.checks import check_surface, places_off_slices
from cccd.surface.control_mesh import control_mesh, fewer_triangles, open_edges, unfold, with_caps
from cccd.surface.smooth_mesh import cut_at_ends, moved_to_ends, smooth_mesh, volume_between
from cccd.surface.stack import CONTROL_BYTES, SliceStack, counts, warnings_of
from cccd.surface.surface import LoftedSurface
from cccd.tolerances import CONTROL_POINT_PIXELS, HELD_VOLUME

#: A limit surface is sampled at so many subdivisions: 4 points for each quad.
SAMPLED = 1
#: Rounds, each one linear system; the distance to the mesh no longer changes by 1 % after these.
ROUNDS = 4
#: In one round a control point is held where it is by this share of the data's weight, which leaves no
#: freedom that the samples do not see ...
HELD = 0.02
#: ... moves at most by this share of its shortest edge, and before that by this share towards the mean of its
#: neighbours along the surface: quads stay even.
MOST_STEP, EVENING = 0.5, 0.5
#: Samples whose nearest triangle faces so far away (cosine) do not count: it is of the other side of a sheet.
FACING = 0.2
#: A sample counts for at least this share of the median sample's area.
LEAST_AREA = 0.1
#: What crosses moves half way back to where it began; then it and what is beside it evens out; then that
#: unfolds. Rounds of each, over when so many have not made it cross less, and those in which normals are
#: averaged: wider than folds are.
BACK, EVENING_OUT, UNFOLDING = range(3)
UNTANGLING_ROUNDS, PATIENCE, NORMAL_ROUNDS = (6, 40, 12), 8, 24
#: Moves by which it comes to hold a volume, at most.
HOLDING_ROUNDS = 3
#: Residual of the linear systems, and most steps to it.
SOLVED, MOST_STEPS = 1e-3, 100


@dataclass(frozen=True, eq=False)
class Target:
    """A mesh of small triangles that a spline is fitted to, as the planes at its vertices.

    Attributes
    ----------
    mesh : Mesh
        Without planar caps: it runs on where the scan ends.
    tree : cKDTree
        Of its vertices.
    """

    mesh: Mesh
    tree: cKDTree

    @classmethod
    def of(cls, mesh: Mesh) -> Target:
        """Take a mesh."""
        return cls(mesh, cKDTree(mesh.vertices))

    def away(self, points: FloatArray, normals: FloatArray) -> tuple[FloatArray, BoolArray]:
        """How far (P,) the mesh is from points (P, 3) along normals, and whether it faces as they do."""
        nearest, points = self.tree.query(points)[1], points[:, :3]
        plane = self.mesh.vertex_normals[nearest]
        cosine = np.einsum("pc,pc->p", plane, normals)
        off = np.einsum("pc,pc->p", self.mesh.vertices[nearest] - points, plane)
        return off / np.maximum(cosine, 0.5), np.asarray(cosine > FACING, np.bool_)


class SplineFit:
    """A spline on its way to a mesh; `fit_spline` makes its rounds.

    Parameters
    ----------
    wall : ControlMesh
        Near the mesh; open where the scan cuts, with creases along these rims, which stay in their planes.
    target : Target
    """

    rounds = UNTANGLING_ROUNDS
    #: Subdivisions at which it is looked at for crossings; by default those with which it is written.
    drawn: int | None = None

    def __init__(self, wall: ControlMesh, target: Target) -> None:
        self.wall, self.target = wall, target
        self.points = wall.vertices.copy()
        sampler = wall.sampler(SAMPLED)
        self.sampling, self.triangles = sampler.matrix, sampler.triangles
        self.rim = np.zeros(self.sampling.shape[0], np.bool_)
        self.rim[open_edges(self.triangles)] = True
        self.edges, _ = quad_edges(wall.quads)
        self.neighbours = neighbour_means(self.edges, wall, self.rim[: len(self.points)])

    @property
    def spline(self) -> ControlMesh:
        """The spline as it is now."""
        return self.wall.moved(self.points)

    def step(self) -> None:
        """Even the control points out, and move them by one linear system."""
        self._even(self._normals(self.sampling @ self.points)[: len(self.points)])
        samples = self.sampling @ self.points
        normals = self._normals(samples)
        along = normals[: len(self.points)]
        missing, facing = self._away(samples, normals)
        area = Mesh(samples, self.triangles).vertex_areas
        weight = np.maximum(area, LEAST_AREA * np.median(area)) * facing
        seen = _scaled(self.sampling, normals, along)
        turned = csr_array(seen.T)
        held = HELD * (self.sampling.T @ np.maximum(weight, LEAST_AREA * np.median(area)))
        diagonal = (seen.multiply(seen)).T @ weight + held
        matrix = LinearOperator(
            (len(along),) * 2, matvec=lambda x: turned @ (weight * (seen @ x)) + held * x, dtype=float
        )
        scale = diags_array(1 / np.maximum(diagonal, 1e-12))
        move, _ = cg(matrix, turned @ (weight * missing), rtol=SOLVED, maxiter=MOST_STEPS, M=scale)
        most = MOST_STEP * self._shortest_edges()
        self.points = self.points + np.clip(move, -most, most)[:, None] * along

    def off(self) -> tuple[FloatArray, FloatArray]:
        """Places (P, 3) on the surface, and how many mm (P,) each is off the mesh."""
        samples = self.sampling @ self.points
        return samples, np.abs(self._away(samples, self._normals(samples))[0])

    def move(self, by: float) -> None:
        """Move the surface outwards by so many mm; rims stay in their planes."""
        self.points = self.points + by * self._normals(self.sampling @ self.points)[: len(self.points)]

    def hold(self, volume: float, times: int | None = None) -> None:
        """Move the surface until it holds so many mm^3 at some subdivisions, or as it is written.

        By the divergence theorem, of a field along the planes where the scan cuts: none flows through them.
        """
        sampler = self.wall.sampler(times)
        for _ in range(HOLDING_ROUNDS):
            drawn = Mesh(sampler.matrix @ self.points, sampler.triangles)
            middle = drawn.vertices[drawn.faces, :2].mean(axis=1)
            held = float(np.einsum("fc,fc->", middle, drawn.face_normals[:, :2])) / 4
            if abs(volume - held) <= HELD_VOLUME * volume:
                break
            self.move((volume - held) / drawn.area)

    def untangle(self, written: Callable[[ControlMesh], FloatArray] = attrgetter("vertices")) -> IntArray:
        """Move control points where the surface passes through itself; the best of some rounds stays.

        They go back to where they began and, where it crosses there too, towards their neighbours' means;
        last, what is folded unfolds.

        Parameters
        ----------
        written : callable, optional
            Gives a spline's control points (V, 3) as they are written: what these make is looked at.

        Returns
        -------
        (K, 2) int64
            Pairs of its triangles that still pass through each other.
        """
        sampler = self.wall.sampler(self.drawn)
        triangles = MovingTriangles(sampler.triangles)

        def pairs_of(points: FloatArray) -> IntArray:
            return triangles.passing_pairs(sampler.matrix @ written(self.wall.moved(points)))

        fewest = pairs_of(self.points)
        for way, rounds in zip((BACK, EVENING_OUT, UNFOLDING), self.rounds, strict=True):
            points, pairs, waited = self.points, fewest, 0
            for _ in range(rounds):
                if not len(pairs) or waited == PATIENCE:
                    break
                near = _moving(sampler, pairs)
                beside = near | (self.neighbours @ near > 0)
                if way == UNFOLDING:
                    facing = _evened_normals(Mesh(sampler.matrix @ points, sampler.triangles))
                    points = unfold(points, sampler, beside & ~self.rim[: len(points)], facing)
                else:
                    moving = near if way == BACK else beside
                    target = self.wall.vertices if way == BACK else self.neighbours @ points
                    points = np.where(moving[:, None], (points + target) / 2, points)
                pairs, waited = pairs_of(points), waited + 1
                if len(pairs) < len(fewest):
                    self.points, fewest, waited = points, pairs, 0
        return fewest

    def _away(self, samples: FloatArray, normals: FloatArray) -> tuple[FloatArray, BoolArray]:
        return self.target.away(samples, normals)

    def _normals(self, samples: FloatArray) -> FloatArray:
        """Give unit normals (P, 3), on a rim within the plane of its cap."""
        normals = Mesh(samples, self.triangles).vertex_normals.copy()
        normals[self.rim, 2] = 0
        normals[self.rim] /= np.maximum(np.linalg.norm(normals[self.rim], axis=1, keepdims=True), 1e-9)
        return normals

    def _shortest_edges(self) -> FloatArray:
        """Length (V,) of the shortest edge at each control point."""
        length = np.linalg.norm(self.points[self.edges[:, 0]] - self.points[self.edges[:, 1]], axis=1)
        shortest = np.full(len(self.points), np.inf)
        np.minimum.at(shortest, self.edges.ravel(), np.repeat(length, 2))
        return shortest

    def _even(self, along: FloatArray) -> None:
        """Move control points towards their neighbours' mean along the surface."""
        way = self.neighbours @ self.points - self.points
        way -= np.einsum("vc,vc->v", way, along)[:, None] * along
        way[self.rim[: len(self.points)], 2] = 0
        self.points = self.points + EVENING * way


def fit_spline(wall: ControlMesh, target: Target) -> SplineFit:
    """Fit a spline to a mesh.

    Parameters
    ----------
    wall : ControlMesh
        Near the mesh; open where the scan cuts, with creases there.
    target : Target
    """
    fit = SplineFit(wall, target)
    for _ in range(ROUNDS):
        fit.step()
    return fit


def _evened_normals(mesh: Mesh) -> FloatArray:
    """Average unit normals (F, 3) of a mesh's triangles without those of small folds."""
    normals = [mesh.averaged(along, NORMAL_ROUNDS) for along in mesh.vertex_normals.T]
    return unit_vectors(np.column_stack(normals)[mesh.faces].sum(axis=1))


def _moving(sampler: Sampler, pairs: IntArray) -> BoolArray:
    """Control points (V,) that move any of some pairs (K, 2) of a sampler's triangles."""
    chosen = np.zeros(len(sampler.matrix.indptr) - 1)
    chosen[sampler.triangles[pairs.ravel()]] = 1
    return np.asarray(sampler.matrix.T @ chosen > 0, np.bool_)


def _scaled(matrix: csr_array, rows: FloatArray, columns: FloatArray) -> csr_array:
    """Multiply each entry by the scalar product of its row's and its column's vectors."""
    of = np.repeat(np.arange(matrix.shape[0]), np.diff(matrix.indptr))
    values = matrix.data * np.einsum("nc,nc->n", rows[of], columns[matrix.indices])
    return csr_array((values, matrix.indices, matrix.indptr), shape=matrix.shape)


def neighbour_means(edges: IntArray, wall: ControlMesh, rim: BoolArray) -> csr_array:
    """Matrix (V, V) of the mean of each control point's neighbours; on a rim, of those along it."""
    count = len(wall.vertices)
    key = np.sort(wall.creases, axis=1) @ [count, 1] if len(wall.creases) else np.zeros(0, np.int64)
    both = np.concatenate([edges, edges[:, ::-1]])
    crease = np.tile(np.isin(edges @ [count, 1], key), 2)
    both = both[~rim[both[:, 0]] | crease]
    links = coo_array((np.ones(len(both)), tuple(both.T)), shape=(count, count)).tocsr()
    return csr_array(diags_array(1 / np.maximum(links.sum(axis=1), 1)) @ links)


#: The coarse mesh begins with one triangle for so many of the mesh that it is made of, and has at most one
#: for so many: what needs more is noise.
COARSEST, COARSER = 150, 5
#: Fewest triangles of a surface.
FEWEST = 100
#: Triangles that are chosen from: so many times those that are left.
SPARE = 8
#: The spline shall be off the mesh by so many pixels (rms): with .03 it is 4 % farther from the truth, with
#: .01 no nearer. A triangle that is n times as far off becomes n.
OFF_PIXELS = 0.024
#: Where the surface is amiss a triangle becomes so many.
AMISS_SPLIT = 4.0
#: Rounds of finer quads where the surface loses a voxel ...
REFINEMENTS = 3
#: ... and further ones where it passes through itself: narrow gaps need quads no wider than they are.
CROSSING_REFINEMENTS = 2
#: Where it is amiss the coarse mesh may have so many times the triangles that it has at most elsewhere.
AMISS_FINER = 2


@dataclass(frozen=True, eq=False)
class SplineSolid:
    """A closed spline, in the plane's mm and height.

    Attributes
    ----------
    spline : ControlMesh
    mesh : Mesh
        Its limit surface at some samples, oriented outwards.
    stack : SliceStack
        What the slices hold.
    crossing : (K, 2) int64, optional
        Pairs of the mesh's triangles that pass through each other as the spline is written; None: not known.
    """

    spline: ControlMesh
    mesh: Mesh
    stack: SliceStack
    crossing: IntArray | None = None

    def to_world(self, frame: Frame) -> LoftedSurface:
        """Return the splines and their mesh in mm RAS."""
        spline = _as_written(self.spline, self.stack)
        mesh = spline.tessellate()
        to_plane = np.asarray(np.linalg.inv(self.stack.to_world), float)
        found = check_surface(mesh.transformed(to_plane), self.stack, self.crossing)
        lines = [violation.line(self.stack.to_world) for violation in found]
        return LoftedSurface(spline.pieces(), mesh, frame, self.report(lines))

    def report(self, violations: Sequence[str] = ()) -> dict[str, Any]:
        """Count and measure, as plain JSON, with warnings; ``violations`` are lines for people."""
        count = len(self.spline.vertices)
        return {
            "control_points": count,
            "control_bytes": CONTROL_BYTES * count,
            "marching_cubes_bytes": self.stack.marching_cubes_bytes,
            "compactness": self.stack.marching_cubes_bytes / (CONTROL_BYTES * count),
            **counts(self.mesh, self.stack),
            "warnings": [*warnings_of(self.stack), *violations],
        }


def _as_written(spline: ControlMesh, stack: SliceStack) -> ControlMesh:
    """Return a spline in mm RAS, its control points rounded: rounding alone may make it cross itself."""
    return spline.transformed(stack.to_world).rounded(CONTROL_POINT_PIXELS * stack.pixel)


def loft_spline(stack: SliceStack, wave: float | None = None) -> SplineSolid:
    """Fit a closed Catmull-Clark spline to what the slices tell.

    Parameters
    ----------
    stack : SliceStack
        What the slices hold.
    wave : float, optional
        Length in mm of the longest waves that are taken off; see `cccd.surface.smooth_mesh`.
    """
    mesh = smooth_mesh(stack, wave)
    wall, crossing = _fit_and_refine(cut_at_ends(mesh, stack.distance), Target.of(mesh), stack)
    spline = with_caps(wall, stack.distance.ends)
    return SplineSolid(spline, spline.tessellate(), stack, crossing if spline is wall else None)


def _fit_and_refine(cut: Mesh, target: Target, stack: SliceStack) -> tuple[ControlMesh, IntArray]:
    """Fit a spline without caps, with finer quads where it is amiss; and its triangles (K, 2) that cross."""
    ends = stack.distance.ends
    volume = volume_between(target.mesh, ends)
    finest = max(FEWEST, len(target.mesh.faces) // COARSER)
    fine, weights, most = _evened(cut, target, finest, stack)
    best: tuple[ControlMesh, IntArray] | None = None
    for attempt in range(1 + REFINEMENTS + CROSSING_REFINEMENTS):
        start, coarse = control_mesh(fine, most, ends, weights)
        fit = fit_spline(start, target)
        fit.hold(volume, 1)
        places = _lost(fit.spline, stack) if attempt < REFINEMENTS else np.zeros((0, 3))
        if not len(places):
            fit.hold(volume)
            crossing = fit.untangle(lambda spline: _as_written(spline, stack).vertices)
            if best is None or len(crossing) < len(best[1]):
                best = fit.spline, crossing
            if not len(crossing) or most >= AMISS_FINER * finest:
                break
            drawn = fit.spline.tessellate()
            places = drawn.vertices[drawn.faces[crossing[:, 0], 0]]
        there = np.zeros(len(coarse.faces), np.bool_)
        there[nearest_faces(places, coarse)] = True
        there = coarse.with_neighbours(there)
        weigh_more(weights, fine, coarse, np.where(there, AMISS_SPLIT, 1.0))
        most = min(len(coarse.faces) + 3 * int(there.sum()), AMISS_FINER * finest)
    assert best is not None
    return best


def _evened(cut: Mesh, target: Target, finest: int, stack: SliceStack) -> tuple[Mesh, FloatArray, int]:
    """Fit a first spline to see where quads have to be finer.

    Returns the mesh whose edges collapse, weights (V,) of its vertices, and how many triangles shall be left.
    """
    most = max(FEWEST, len(target.mesh.faces) // COARSEST)
    start, coarse = control_mesh(_spared(cut, most, stack), most, stack.distance.ends)
    places, off = fit_spline(start, target).off()
    near, count = nearest_faces(places, coarse), len(coarse.faces)
    mean = np.bincount(near, off**2, count) / np.maximum(np.bincount(near, minlength=count), 1)
    times = np.clip(np.sqrt(mean) / (OFF_PIXELS * stack.pixel), 1.0, COARSEST / COARSER)
    most = min(round(float(times.sum())), finest)
    fine = _spared(cut, most, stack)
    weights = np.ones(len(fine.vertices))
    weigh_more(weights, fine, coarse, times)
    return fine, weights, most


def _spared(cut: Mesh, most: int, stack: SliceStack) -> Mesh:
    """Collapse edges of a mesh until so many triangles can be chosen from it."""
    fine = moved_to_ends(ahead(cut, SPARE * most), stack.distance)
    return fewer_triangles(fine, SPARE * most, stack.distance.ends)


def _lost(spline: ControlMesh, stack: SliceStack) -> FloatArray:
    """Places (P, 3) where a spline leaves the slices' outlines or has voxels on its wrong side."""
    return places_off_slices(with_caps(spline, stack.distance.ends).tessellate(1), stack)[0]
