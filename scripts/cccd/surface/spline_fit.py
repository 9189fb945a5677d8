"""Fit a Catmull-Clark spline to signed distances: sparse least squares with a thin plate's stiffness.

Control points move along the surface's normals, so that at samples of the limit surface the distances vanish
(Gauss and Newton's steps), as far as a thin plate lets them. The plate is as stiff as pixels' steps ask for,
and softer where it keeps the surface off the slices by more than noise would: there is a detail.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array, csr_array, diags_array
from scipy.sparse.linalg import cg

from cccd.geometry.arrays import BoolArray, FloatArray, IntArray
from cccd.geometry.mesh import Mesh
from cccd.geometry.subdivision import ControlMesh, Sampler, quad_edges
from cccd.surface.sampled import SampledDistance

__all__ = ["SplineFit", "fit_spline"]

#: A limit surface is sampled at so many subdivisions: 16 points for each quad.
SAMPLED = 2
#: Waves of 2 pi times so many pixels are halved by the plate: pixels' steps are shorter.
STIFF_PIXELS = 1.25
#: It softens where the surface stays off the slices by this, in pixels, on the mean of a quad's samples, and
#: never below that of so many pixels.
DETAIL_PIXELS, SOFTEST_PIXELS = 0.05, 0.2
#: Rounds: each is one linear system; after these control points move by less than a hundredth of a pixel.
ROUNDS = 8
#: Distances that grow by less than this per mm are of no use; from the second on they count fully.
STEEP = (0.3, 0.8)
#: In one round a control point moves at most by this share of its shortest edge ...
MOST_STEP = 0.2
#: ... is held where it is by this share of the data's weight ...
DAMPING = 0.05
#: ... and goes by this share towards its neighbours' mean along the surface: quads stay even.
EVENING = 0.5
#: The surface is moved at most by so many pixels to hold the slices' volume.
MOST_OFFSET = 0.5
#: Cotangents are kept between these: needles would weigh too much.
COTANGENTS = (0.05, 3.0)
#: A sample counts for at least this share of the median sample's area.
LEAST_AREA = 0.1
#: Residual of the linear systems.
SOLVED = 1e-3


@dataclass(frozen=True, eq=False)
class _Caps:
    """What of a spline lies on planar caps: it stays in their planes.

    Attributes
    ----------
    faces : (T,) bool
        Triangles of the samples that do.
    rim, inner : (P,) bool
        Samples on the rims, and within the caps; the first ones are the control points'.
    """

    faces: BoolArray
    rim: BoolArray
    inner: BoolArray

    @classmethod
    def of(cls, points: FloatArray, triangles: IntArray, ends: tuple[float, float]) -> _Caps:
        on = np.zeros(len(points), np.bool_)
        for end in ends:
            if np.isfinite(end):
                on |= np.isclose(points[:, 2], end, rtol=0, atol=1e-6)
        faces = np.asarray(np.all(on[triangles], axis=1), np.bool_)
        wall, cap = np.zeros((2, len(points)), np.bool_)
        wall[triangles[~faces]] = True
        cap[triangles[faces]] = True
        return cls(faces, cap & wall, cap & ~wall)


class SplineFit:
    """A spline on its way to the distances; `fit_spline` makes its rounds.

    Parameters
    ----------
    spline : ControlMesh
        In the plane's mm and height in mm.
    distance : SampledDistance
    """

    def __init__(self, spline: ControlMesh, distance: SampledDistance) -> None:
        self.spline, self.distance = spline, distance
        self.points = spline.vertices.copy()
        self.count = len(self.points)
        sampler = Sampler.of(spline, SAMPLED)
        self.sampling, self.triangles = sampler.matrix, sampler.triangles
        samples = self.sampling @ self.points
        self.caps = _Caps.of(samples, self.triangles, distance.ends)
        self.edges, _ = quad_edges(spline.quads)
        self.neighbours = _neighbour_means(self.edges, spline, self.caps.rim[: self.count])
        laplacian, self.mass = _cotangent(samples, self.triangles[~self.caps.faces])
        free = diags_array((~(self.caps.rim | self.caps.inner)).astype(float))
        self.bending = csr_array(free @ laplacian @ self.sampling)
        self.stiffness = np.full(len(samples), (STIFF_PIXELS * distance.pixel) ** 4)

    def with_spline(self, spline: ControlMesh) -> SplineFit:
        """Return a fit, not moved, of the same quads with other control points and creases."""
        return SplineFit(spline, self.distance)

    @property
    def mesh(self) -> Mesh:
        """The limit surface at its samples."""
        return Mesh(self.sampling @ self.points, self.triangles)

    def strays(self, pixels: float) -> BoolArray:
        """Mark triangles (T,) with a sample that lies off the distances' zero by so many pixels."""
        off = np.abs(self.distance(self.sampling @ self.points)) > pixels * self.distance.pixel
        return np.any((off & ~self.caps.inner)[self.triangles], axis=1)

    def step(self) -> None:
        """Move the control points by one linear system."""
        samples = self.sampling @ self.points
        normals = self._normals(samples)
        along = normals[: self.count]
        value, slope = self.distance(samples), self.distance.slopes(samples, normals)
        weight = self._weights(slope)
        seen = _scaled(self.sampling, normals, along)
        self._soften(value, weight)
        plate = csr_array(self.bending.T @ (diags_array(self.stiffness / self.mass) @ self.bending))
        moving = np.any(along != 0, axis=1)
        held = np.where(moving, DAMPING * (self.sampling.T @ self.mass), 1.0)
        matrix = csr_array(
            seen.T @ (diags_array(weight) @ seen) + _scaled(plate, along, along) + diags_array(held)
        )
        right = seen.T @ (-weight * value / np.maximum(slope, STEEP[0]))
        right -= np.einsum("vc,vc->v", along, plate @ self.points)
        scale = diags_array(1 / np.maximum(matrix.diagonal(), 1e-12))
        move, _ = cg(matrix, right, rtol=SOLVED, maxiter=500, M=scale)
        most = MOST_STEP * self._shortest_edges()
        self.points = self.points + np.clip(move, -most, most)[:, None] * along
        self._even(along)

    def hold_volume(self, volume: float) -> None:
        """Move the surface, but for its caps, outwards or inwards to hold a volume in mm^3."""
        most, moved = MOST_OFFSET * self.distance.pixel, 0.0
        for _ in range(3):
            mesh = self.mesh
            wall = Mesh(mesh.vertices, mesh.faces[~self.caps.faces])
            missing = (volume - mesh.volume) / max(wall.area, 1e-9)
            missing = float(np.clip(moved + missing, -most, most)) - moved
            moved += missing
            self.points = self.points + missing * self._normals(mesh.vertices)[: self.count]

    def _normals(self, samples: FloatArray) -> FloatArray:
        """Give unit normals (P, 3), in the cap's plane on its rim, zero within it."""
        normals = Mesh(samples, self.triangles[~self.caps.faces]).vertex_normals.copy()
        rim = self.caps.rim
        normals[rim, 2] = 0
        normals[rim] /= np.maximum(np.linalg.norm(normals[rim], axis=1, keepdims=True), 1e-9)
        normals[self.caps.inner] = 0
        return normals

    def _weights(self, slope: FloatArray) -> FloatArray:
        """Weights (P,) of the distances: by area, less where distances hardly change."""
        steep = np.where(slope > 0, np.clip(slope / STEEP[1], 0.01, 1) ** 2, 0)
        return self.mass * steep * ~self.caps.inner

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
        shortest = np.full(self.count, np.inf)
        np.minimum.at(shortest, self.edges.ravel(), np.repeat(length, 2))
        return shortest

    def _even(self, along: FloatArray) -> None:
        """Move control points towards their neighbours' mean along the surface."""
        way = self.neighbours @ self.points - self.points
        way -= np.einsum("vc,vc->v", way, along)[:, None] * along
        way[(self.caps.rim | self.caps.inner)[: self.count], 2] = 0
        self.points = self.points + EVENING * way


def fit_spline(spline: ControlMesh, distance: SampledDistance, volume: float | None) -> SplineFit:
    """Fit a spline to distances.

    Parameters
    ----------
    spline : ControlMesh
        Near the surface, in the plane's mm and height in mm; planar caps have creases around them.
    distance : SampledDistance
    volume : float or None
        mm^3 that the surface shall hold in the end; None leaves it where the distances have it.
    """
    fit = SplineFit(spline, distance)
    for _ in range(ROUNDS):
        fit.step()
    if volume is not None:
        fit.hold_volume(volume)
    return fit


def _scaled(matrix: csr_array, rows: FloatArray, columns: FloatArray) -> csr_array:
    """Multiply each entry by the scalar product of its row's and its column's vectors."""
    row = np.repeat(np.arange(matrix.shape[0]), np.diff(matrix.indptr))
    data = matrix.data * np.einsum("kc,kc->k", rows[row], columns[matrix.indices])
    return csr_array((data, matrix.indices, matrix.indptr), shape=matrix.shape)


def _neighbour_means(edges: IntArray, spline: ControlMesh, rim: BoolArray) -> csr_array:
    """Matrix (V, V) of the mean of each control point's neighbours; on a rim, of those along it."""
    count = len(spline.vertices)
    key = np.sort(spline.creases, axis=1) @ [count, 1] if len(spline.creases) else np.zeros(0, np.int64)
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
    mass = np.bincount(faces.ravel(), np.repeat(Mesh(points, faces).face_areas / 3, 3), count)
    laplacian = csr_array(links - diags_array(np.asarray(links.sum(axis=1)).ravel()))
    return laplacian, np.maximum(mass, LEAST_AREA * np.median(mass))
