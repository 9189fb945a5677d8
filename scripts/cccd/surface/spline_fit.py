"""Fit a Catmull-Clark spline to signed distances: sparse least squares with a thin plate's stiffness.

Control points move along the surface's normals, so that at samples of the limit surface the distances vanish
(Gauss and Newton's steps), as far as a thin plate lets them. The plate is as stiff as pixels' steps ask for,
and softer where it keeps the surface off the slices by more than noise would: there is a detail.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.sparse import coo_array, csr_array, diags_array
from scipy.sparse.linalg import cg

from cccd.geometry._jit import jit
from cccd.geometry.arrays import AnyArray, BoolArray, FloatArray, IntArray
from cccd.geometry.collisions import MovingTriangles
from cccd.geometry.mesh import Mesh
from cccd.geometry.squared_pattern import SquaredPattern
from cccd.geometry.subdivision import ControlMesh, Sampler, quad_edges
from cccd.surface.control_mesh import open_edges
from cccd.surface.sampled import SampledDistance

__all__ = ["Curvature", "SplineFit", "fit_spline"]

Curvature = Callable[[FloatArray], FloatArray]

#: A limit surface is sampled at so many subdivisions: 4 points for each quad, of which a coarse one has four.
SAMPLED = 1
#: Waves of 2 pi times so many pixels are halved by the plate: pixels' steps are shorter.
STIFF_PIXELS = 1.0
#: ... or times this share of the radius of curvature: a plate that is stiffer pulls thin branches together.
STIFF_SHARE = 0.3
#: It softens where the surface stays off the slices by this, in pixels, on the mean of a quad's samples, and
#: never below that of so many pixels.
DETAIL_PIXELS, SOFTEST_PIXELS = 0.05, 0.2
#: Rounds: each is one linear system; more change distances to a known surface by less than 1 %.
ROUNDS = 5
#: Distances that grow by less than this per mm are of no use; from the second on they count fully.
STEEP = (0.3, 0.8)
#: In one round a control point moves at most by this share of its shortest edge ...
MOST_STEP = 0.2
#: ... is held where it is by this share of the data's weight ...
DAMPING = 0.05
#: ... and goes by this share towards its neighbours' mean along the surface: quads stay even.
EVENING = 0.5
#: Rounds in which what crosses moves half way back to where it began, and rounds in which it evens out.
UNTANGLING_ROUNDS = 6
#: The surface is moved at most by so many pixels to hold the slices' volume.
MOST_OFFSET = 0.5
#: Cotangents are kept between these: needles would weigh too much.
COTANGENTS = (0.05, 3.0)
#: A sample counts for at least this share of the median sample's area.
LEAST_AREA = 0.1
#: Curvatures count as at least this, in 1/mm.
LEAST_CURVATURE = 1e-6
#: Residual of the linear systems.
SOLVED = 1e-3


class SplineFit:
    """A spline on its way to the distances; `fit_spline` makes its rounds.

    Parameters
    ----------
    wall : ControlMesh
        In the plane's mm and height in mm; open where the scan cuts, with creases along these rims, which
        stay in their planes.
    distance : SampledDistance
    curvature : callable
        Gives the curvature (P,) in 1/mm that the surface has near points (P, 3).
    """

    def __init__(self, wall: ControlMesh, distance: SampledDistance, curvature: Curvature) -> None:
        self.wall, self.distance = wall, distance
        self.points = wall.vertices.copy()
        sampler = wall.sampler(SAMPLED)
        self.sampling, self.triangles = sampler.matrix, sampler.triangles
        samples = self.sampling @ self.points
        self.rim = np.zeros(len(samples), np.bool_)
        self.rim[open_edges(self.triangles)] = True
        self.edges, _ = quad_edges(wall.quads)
        self.neighbours = _neighbour_means(self.edges, wall, self.rim[: len(self.points)])
        laplacian, self.mass = _cotangent(samples, self.triangles)
        free = diags_array((~self.rim).astype(float))
        self.bending = csr_array(free @ laplacian @ self.sampling)
        self.bending.sort_indices()
        self.squared = SquaredPattern(self.bending, self.sampling)
        radius = 1 / np.maximum(curvature(samples), LEAST_CURVATURE)
        self.stiffness = np.minimum(STIFF_PIXELS * distance.pixel, STIFF_SHARE * radius) ** 4

    @property
    def spline(self) -> ControlMesh:
        """The spline as it is now."""
        return self.wall.moved(self.points)

    def step(self) -> None:
        """Move the control points by one linear system."""
        samples = self.sampling @ self.points
        normals = self._normals(samples)
        along = normals[: len(self.points)]
        value, slope = self.distance(samples), self.distance.slopes(samples, normals)
        weight = self.mass * np.where(slope > 0, np.clip(slope / STEEP[1], 0.01, 1) ** 2, 0)
        seen = _scaled(self.sampling, normals, along)
        self._soften(value / np.maximum(slope, 1), weight)
        plate = self.squared.product(0, self.bending.data, self.stiffness / self.mass)
        moving = np.any(along != 0, axis=1)
        held = np.where(moving, DAMPING * (self.sampling.T @ self.mass), 1.0)
        matrix = self.squared.product(1, seen.data, weight)
        matrix.data += _scaled(plate, along, along).data
        matrix.data[self.squared.diagonal] += held
        right = seen.T @ (-weight * value / np.maximum(slope, STEEP[0]))
        right -= np.einsum("vc,vc->v", along, plate @ self.points)
        scale = diags_array(1 / np.maximum(matrix.diagonal(), 1e-12))
        move, _ = cg(matrix, right, rtol=SOLVED, maxiter=500, M=scale)
        most = MOST_STEP * self._shortest_edges()
        self.points = self.points + np.clip(move, -most, most)[:, None] * along
        self._even(along)

    def hold_volume(self, missing: float) -> None:
        """Move the wall outwards by as much as it lacks of a volume in mm^3, within `MOST_OFFSET`."""
        samples = self.sampling @ self.points
        most = MOST_OFFSET * self.distance.pixel
        by = np.clip(missing / max(Mesh(samples, self.triangles).area, 1e-9), -most, most)
        self.points = self.points + by * self._normals(samples)[: len(self.points)]

    def untangle(self, times: int) -> bool:
        """Move control points where the surface passes through itself; the best of some rounds stays.

        They go back to where they began and, where it crosses there too, towards their neighbours' means.

        Parameters
        ----------
        times : int
            Subdivisions at which it is looked at: as many as the mesh that is written has.

        Returns
        -------
        bool
            Whether it passes nowhere through itself any more.
        """
        sampler = self.wall.sampler(times)
        triangles = MovingTriangles(sampler.triangles)
        fewest, best = np.inf, self.points
        for back in (True, False):
            points, moving = best, np.zeros(len(best), np.bool_)
            for _ in range(1 + UNTANGLING_ROUNDS):
                pairs = triangles.passing_pairs(sampler.matrix @ points)
                number, near = len(pairs), _moving(sampler, pairs)
                if number < fewest:
                    fewest, best = number, points
                if not number:
                    self.points = best
                    return True
                moving |= near
                target = self.wall.vertices if back else self.neighbours @ points
                points = np.where(moving[:, None], (points + target) / 2, points)
        self.points = best
        return False

    def _normals(self, samples: FloatArray) -> FloatArray:
        """Give unit normals (P, 3), on a rim within the plane of its cap."""
        normals = Mesh(samples, self.triangles).vertex_normals.copy()
        normals[self.rim, 2] = 0
        normals[self.rim] /= np.maximum(np.linalg.norm(normals[self.rim], axis=1, keepdims=True), 1e-9)
        return normals

    def _soften(self, value: FloatArray, weight: FloatArray) -> None:
        """Make the plate softer where it keeps the surface off the slices on the mean of a quad's samples."""
        total = np.maximum(self.sampling.T @ weight, 1e-12)
        off = self.sampling @ ((self.sampling.T @ (weight * value)) / total)
        pixel = self.distance.pixel
        softer = self.stiffness / (1 + (off / (DETAIL_PIXELS * pixel)) ** 2)
        self.stiffness = np.maximum(softer, (SOFTEST_PIXELS * pixel) ** 4)

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


def fit_spline(wall: ControlMesh, distance: SampledDistance, curvature: Curvature) -> SplineFit:
    """Fit a spline to distances.

    Parameters
    ----------
    wall : ControlMesh
        Near the surface, in the plane's mm and height in mm; open where the scan cuts, with creases there.
    distance : SampledDistance
    curvature : callable
        Gives the curvature (P,) in 1/mm that the surface has near points (P, 3).
    """
    fit = SplineFit(wall, distance, curvature)
    for _ in range(ROUNDS):
        fit.step()
    return fit


def _moving(sampler: Sampler, pairs: IntArray) -> BoolArray:
    """Control points (V,) that move any of some pairs (K, 2) of a sampler's triangles."""
    chosen = np.zeros(len(sampler.matrix.indptr) - 1)
    chosen[sampler.triangles[pairs.ravel()]] = 1
    return np.asarray(sampler.matrix.T @ chosen > 0, np.bool_)


def _scaled(matrix: csr_array, rows: FloatArray, columns: FloatArray) -> csr_array:
    """Multiply each entry by the scalar product of its row's and its column's vectors."""
    values = np.empty_like(matrix.data)
    _write_scaled((matrix.indptr, matrix.indices, matrix.data), rows, columns, values)
    return csr_array((values, matrix.indices, matrix.indptr), shape=matrix.shape)


@jit
def _write_scaled(
    matrix: tuple[AnyArray, AnyArray, FloatArray], rows: FloatArray, columns: FloatArray, values: FloatArray
) -> None:
    """Write the entries of a sparse matrix (starts of rows, columns, values), multiplied."""
    for i in range(len(matrix[0]) - 1):
        for n in range(matrix[0][i], matrix[0][i + 1]):
            j = matrix[1][n]
            product = rows[i, 0] * columns[j, 0] + rows[i, 2] * columns[j, 2] + rows[i, 1] * columns[j, 1]
            values[n] = matrix[2][n] * product


def _neighbour_means(edges: IntArray, wall: ControlMesh, rim: BoolArray) -> csr_array:
    """Matrix (V, V) of the mean of each control point's neighbours; on a rim, of those along it."""
    count = len(wall.vertices)
    key = np.sort(wall.creases, axis=1) @ [count, 1] if len(wall.creases) else np.zeros(0, np.int64)
    both = np.concatenate([edges, edges[:, ::-1]])
    crease = np.tile(np.isin(edges @ [count, 1], key), 2)
    both = both[~rim[both[:, 0]] | crease]
    links = coo_array((np.ones(len(both)), tuple(both.T)), shape=(count, count)).tocsr()
    return csr_array(diags_array(1 / np.maximum(links.sum(axis=1), 1)) @ links)


def _cotangent(points: FloatArray, faces: IntArray) -> tuple[csr_array, FloatArray]:
    """Laplacian (V, V) of triangles by cotangents (Pinkall and Polthier 1993), and the vertices' areas."""
    count = len(points)
    rows: list[IntArray] = []
    columns: list[IntArray] = []
    values: list[FloatArray] = []
    for k in range(3):
        i, j, apex = faces[:, (k + 1) % 3], faces[:, (k + 2) % 3], faces[:, k]
        u, v = points[i] - points[apex], points[j] - points[apex]
        sine = np.maximum(np.linalg.norm(np.cross(u, v), axis=1), 1e-9)
        weight = np.clip(np.einsum("fc,fc->f", u, v) / sine, *COTANGENTS) / 2
        rows += [i, j]
        columns += [j, i]
        values += [weight, weight]
    links = coo_array(
        (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=(count, count)
    ).tocsr()
    mass = Mesh(points, faces).vertex_areas
    laplacian = csr_array(links - diags_array(np.asarray(links.sum(axis=1)).ravel()))
    return laplacian, np.maximum(mass, LEAST_AREA * np.median(mass))
