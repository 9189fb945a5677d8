"""Move a template onto a subject: similarity, then smooth modes, then all control points.

Each round pairs samples of the spline with the subject's surface, in both directions and by place and normal,
and solves one least squares for distances along normals plus what the displacement bends. What bends over
less than a length costs much; the length falls from the organ's size to a quad's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array, diags_array, hstack
from scipy.sparse.linalg import LinearOperator, SuperLU, cg
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from cccd.geometry.arrays import FloatArray, IntArray
from cccd.geometry.distance import unsigned_to_mesh
from cccd.geometry.mesh import Mesh
from cccd.geometry.subdivision import ControlMesh
from cccd.surface.spline import SAMPLED, SplineFit, Target
from cccd_shapes.template import Template

#: Triangles of a subject's mesh that are used at most.
MOST_TRIANGLES = 40_000
#: Lengths, as shares of the organ's radius, over which the modes may bend; rounds at each.
MODE_LENGTHS, MODE_ROUNDS = (0.7, 0.4, 0.25, 0.16, 0.1, 0.06), 3
#: Lengths, in edges of a quad, over which all control points may bend; rounds at each.
POINT_LENGTHS, POINT_ROUNDS = (1.6, 0.9, 0.5), 2
#: Share of the data's weight by which control points stay where they are.
HELD = 1e-4
#: Residual of the linear systems, and most steps to it.
SOLVED, MOST_STEPS = 1e-2, 100
#: Normals that agree less (cosine) are of the other side of a sheet.
FACING = 0.2
#: Most rounds of the similarity, and the change, as a share of the radius, at which it ends.
SIMILAR_ROUNDS, STILL = 40, 1e-4


class Goal:
    """A subject's surface, closed and oriented outwards, as a template looks for it, in its mm."""

    def __init__(self, mesh: Mesh) -> None:
        self.mesh = mesh.simplified(MOST_TRIANGLES)
        self.normals = self.mesh.vertex_normals
        self.areas = self.mesh.vertex_areas
        self._trees: dict[float, cKDTree] = {}

    def tree(self, turned: float) -> cKDTree:
        """Tree of the vertices by place and normal, of which one radian counts as so many mm."""
        if turned not in self._trees:
            self._trees = {turned: cKDTree(np.hstack([self.mesh.vertices, turned * self.normals]))}
        return self._trees[turned]

    def seen(self, count: int) -> IntArray:
        """Choose vertices by their areas, at most ``count``; the same ones each time."""
        if count >= len(self.areas):
            return np.flatnonzero(self.areas > 0)
        draw = np.random.default_rng(0).random(len(self.areas))
        # the largest of draw^(1/area): a sample without replacement by area (Efraimidis and Spirakis 2006)
        return np.argsort(np.log(draw) / np.maximum(self.areas, 1e-12))[-count:]


class _Pairs(NamedTuple):
    """Samples of the spline (P,), directions (P, 3), how far (P,) along them to the subject, weights (P,)."""

    sample: IntArray
    normal: FloatArray
    off: FloatArray
    weight: FloatArray


def _pairs(points: FloatArray, triangles: IntArray, goal: Goal, turned: float) -> _Pairs:
    """Pair samples (P, 3) of the spline and the subject's surface, each with the nearest of the other.

    A normal that is turned by one radian is as far off as ``turned`` mm: the organ's radius, or less.
    """
    spline, seen = Mesh(points, triangles), goal.seen(len(points))
    normals = spline.vertex_normals
    placed = np.hstack([points, turned * normals])
    nearest = goal.tree(turned).query(placed)[1]
    back = cKDTree(placed).query(np.hstack([goal.mesh.vertices[seen], turned * goal.normals[seen]]))[1]
    sample = np.concatenate([np.arange(len(points)), back])
    vertex = np.concatenate([nearest, seen])
    normal = goal.normals[vertex]
    off = np.einsum("pc,pc->p", goal.mesh.vertices[vertex] - points[sample], normal)
    areas = goal.areas[seen] if len(seen) == len(goal.areas) else np.ones(len(seen))
    weight = np.concatenate([spline.vertex_areas, areas])
    weight *= np.einsum("pc,pc->p", normal, normals[sample]) > FACING
    for way in np.split(weight, [len(points)]):
        way /= 2 * max(way.sum(), 1e-12)  # both ways count as much
    return _Pairs(sample, normal, off, weight)


def similarity(template: Template, mesh: Mesh) -> FloatArray:
    """Find the similarity (4, 4) from a template onto a closed mesh (mm); it starts along the same axes."""
    goal, sampler = Goal(mesh), template.spline.sampler(0)
    start = template.spline.tessellate(0)
    scale = float(np.sqrt(goal.mesh.area / template.area))
    centre = centroid(goal.mesh)
    affine = np.diag([scale, scale, scale, 1.0])
    affine[:3, 3] = centre - scale * centroid(start)
    radius = scale * template.radius
    for _ in range(SIMILAR_ROUNDS):
        points = start.vertices @ affine[:3, :3].T + affine[:3, 3]
        pairs = _pairs(points, sampler.triangles, goal, radius)
        arm = points[pairs.sample] - centre
        grown = np.einsum("pc,pc->p", arm, pairs.normal)[:, None]
        matrix = np.hstack([np.cross(arm, pairs.normal), pairs.normal, grown])
        weighted = matrix * pairs.weight[:, None]
        # what the surface does not tell, as of a sphere's turning, stays as it is
        held = np.diag(1e-6 * np.trace(weighted.T @ matrix) / 7 * np.ones(matrix.shape[1]))
        move = np.asarray(np.linalg.solve(weighted.T @ matrix + held, weighted.T @ pairs.off), float)
        step = _small_similarity(move, centre)
        affine = step @ affine
        if np.abs(step - np.eye(4))[:3].max() < STILL * max(1.0, radius):
            break
    return affine


def centroid(mesh: Mesh) -> FloatArray:
    """Mean of the surface (3,)."""
    return np.asarray(np.average(mesh.vertices, axis=0, weights=mesh.vertex_areas), float)


def _small_similarity(move: FloatArray, centre: FloatArray) -> FloatArray:
    """Similarity (4, 4) around a centre of a rotation vector, a shift and a growth (7,)."""
    affine = np.eye(4)
    growth = float(np.exp(np.clip(move[6], -0.2, 0.2)))
    angle = float(np.linalg.norm(move[:3]))
    turn = move[:3] * min(1.0, 0.3 / max(angle, 1e-12))  # at most .3 radians a round
    affine[:3, :3] = growth * np.asarray(Rotation.from_rotvec(turn).as_matrix())
    affine[:3, 3] = centre + move[3:6] - affine[:3, :3] @ centre
    return affine


@dataclass(frozen=True, eq=False)
class Fit:
    """A template on a subject."""

    spline: ControlMesh  # the template's quads on the subject, in its mm
    rms: float  # root mean square distance in mm of both surfaces to each other
    crossings: int  # pairs of triangles of the fitted surface that pass through each other


def fit_template(template: Template, mesh: Mesh, start: FloatArray | None = None) -> Fit:
    """Fit a template's spline to a subject.

    Parameters
    ----------
    template : Template
    mesh : Mesh
        Of the subject, closed and oriented outwards, in mm.
    start : (V, 3) float64, optional
        Control points near the subject; by default, similarity and smooth modes find some.

    Examples
    --------
    >>> import trimesh
    >>> from cccd_shapes.template import control_mesh_of
    >>> ball = trimesh.creation.icosphere(4, 10.0)
    >>> mesh = Mesh(np.array(ball.vertices), np.array(ball.faces, np.int64))
    >>> longer = Mesh(mesh.vertices * (1, 1, 1.3), mesh.faces)
    >>> fit = fit_template(Template(control_mesh_of(mesh, 300)), longer)
    >>> fit.rms < 0.05, fit.crossings
    (True, 0)
    """
    affine = similarity(template, mesh) if start is None else np.eye(4)
    goal = Goal(mesh.transformed(np.asarray(np.linalg.inv(affine), float)))
    smooth = _by_modes(template, goal) if start is None else start
    points = fit_points(template, smooth[None], [goal], np.ones((1, 1)))[0]
    fit = SplineFit(template.spline.moved(smooth), Target.of(goal.mesh))
    fit.points = points
    crossings = len(fit.untangle())
    spline = fit.spline.transformed(affine)
    return Fit(spline, surface_rms(spline.tessellate(), mesh), crossings)


def surface_rms(first: Mesh, second: Mesh) -> float:
    """Root mean square distance in mm between two surfaces, from the vertices of both."""
    there = np.average(unsigned_to_mesh(first.vertices, second) ** 2, weights=first.vertex_areas)
    back = np.average(unsigned_to_mesh(second.vertices, first) ** 2, weights=second.vertex_areas)
    return float(np.sqrt((there + back) / 2))


def _by_modes(template: Template, goal: Goal) -> FloatArray:
    """Control points (V, 3) that smooth modes move onto the subject's surface."""
    modes, points, sampler = template.modes, template.spline.vertices, template.spline.sampler(SAMPLED)
    count = modes.shape[1]
    sampled = sampler.matrix @ modes
    bent = np.einsum("vk,vk->k", modes, template.bending @ modes)
    amounts = np.zeros((3, count))
    for length in np.repeat(MODE_LENGTHS, MODE_ROUNDS) * template.radius:
        now = points + (amounts @ modes.T).T
        pairs = _pairs(sampler.matrix @ now, sampler.triangles, goal, template.radius)
        rows = np.hstack([pairs.normal[:, axis, None] * sampled[pairs.sample] for axis in range(3)])
        weighted = rows * pairs.weight[:, None]
        penalty = np.tile(length**4 * bent, 3) + 1e-6
        system = weighted.T @ rows + np.diag(penalty)
        move = np.linalg.solve(system, weighted.T @ pairs.off - penalty * amounts.ravel())
        amounts = amounts + move.reshape(3, count)
    return points + (amounts @ modes.T).T


def fit_points(
    template: Template, smooth: FloatArray, goals: Sequence[Goal], basis: FloatArray
) -> FloatArray:
    """Fit all control points, from smooth ones on, of one subject or of all frames of a series at once.

    ``smooth`` (K, V, 3) are coefficients in time, ``basis`` (F, K) says how much each counts in each frame;
    one subject has one frame, and its control points are the coefficients.
    """
    solvers = {length: template.solver(length * template.edge) for length in POINT_LENGTHS}
    made, start, sampler = smooth, np.tensordot(basis, smooth, 1), template.spline.sampler(SAMPLED)
    size = (3 * smooth.shape[0] * smooth.shape[1],) * 2
    weigh = np.asarray(np.linalg.inv(basis.T @ basis), float)
    for edges in np.repeat(POINT_LENGTHS, POINT_ROUNDS):
        length = edges * template.edge
        frames: list[tuple[csr_array, csr_array]] = []
        wanted: list[FloatArray] = []
        for points, begin, goal in zip(np.tensordot(basis, made, 1), start, goals, strict=True):
            pairs = _pairs(sampler.matrix @ points, sampler.triangles, goal, length)
            chosen = csr_array(sampler.matrix[pairs.sample])
            rows = csr_array(hstack([diags_array(pairs.normal[:, axis]) @ chosen for axis in range(3)]))
            frames.append((rows, csr_array(rows.T @ diags_array(pairs.weight))))
            # bending is counted from the smooth fit: the large changes of shape are no distortion
            pull = (length**4 * template.bending @ (points - begin)).T.ravel()
            wanted.append(frames[-1][1] @ pairs.off - pull)
        stiffness = csr_array(length**4 * template.bending + HELD * template.metric)
        matrix = LinearOperator(size, partial(_system, stiffness, frames, basis), dtype=float)
        before = LinearOperator(size, partial(_nearly, solvers[edges], weigh), dtype=float)
        right = (basis.T @ np.array(wanted)).ravel()
        move, _ = cg(matrix, right, rtol=SOLVED, maxiter=MOST_STEPS, M=before)
        made = made + move.reshape(len(smooth), 3, -1).transpose(0, 2, 1)
    return made


def _system(
    stiffness: csr_array, frames: Sequence[tuple[csr_array, csr_array]], basis: FloatArray, move: FloatArray
) -> FloatArray:
    """Multiply displacements (K 3 V,) by the matrix of the least squares."""
    at = basis @ move.reshape(basis.shape[1], -1)
    found = [
        turned @ (rows @ one) + (stiffness @ one.reshape(3, -1).T).T.ravel()
        for (rows, turned), one in zip(frames, at, strict=True)
    ]
    return np.asarray((basis.T @ np.array(found)).ravel(), float)


def _nearly(solver: SuperLU, weigh: FloatArray, move: FloatArray) -> FloatArray:
    """Solve the same for displacements along each axis by themselves, as if normals had all directions."""
    count = solver.shape[0]
    solved = solver.solve(np.ascontiguousarray(move.reshape(-1, count).T)).T
    return np.asarray((weigh @ solved.reshape(len(weigh), -1)).ravel(), float)
