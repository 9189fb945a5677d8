"""How well a result agrees with the truth: regions, and surfaces."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy

from cccd.geometry.arrays import FloatArray
from cccd.geometry.distance import nearest_faces, unsigned_to_mesh
from cccd.geometry.mesh import Mesh

#: Points at which normals are compared.
ANGLES = 10_000


def dice(
    truth: np.ndarray, predicted: np.ndarray, axis: int | tuple[int, ...] | None = None
) -> np.ndarray | float:
    """Dice score, eq. (20), of regions of one shape, over all axes or some; two empty regions agree (1)."""
    if np.shape(truth) != np.shape(predicted):
        raise ValueError(f"truth {np.shape(truth)} and prediction {np.shape(predicted)} differ in shape")
    both = np.asarray(np.count_nonzero(np.logical_and(truth, predicted), axis=axis))
    total = np.asarray(np.count_nonzero(truth, axis=axis) + np.count_nonzero(predicted, axis=axis))
    return np.divide(2 * both, total, out=np.ones(np.shape(total)), where=total > 0)[()]


class Gaps(NamedTuple):
    """Distances in mm from points on each of two surfaces to the other, the points uniform by area.

    Attributes
    ----------
    there, back : (count,) float64
        From the first surface, and from the second.
    farthest : float
        The largest distance of these points, and of the vertices.
    areas : tuple of float
        Areas of the two surfaces.
    """

    there: FloatArray
    back: FloatArray
    farthest: float
    areas: tuple[float, float]

    @classmethod
    def between(cls, first: Mesh, second: Mesh, rng: np.random.Generator, count: int = 50_000) -> Gaps:
        """Measure them, from ``count`` points on each mesh."""
        points, others = first.sample(count, rng), second.sample(count, rng)
        there, back = unsigned_to_mesh(points, second), unsigned_to_mesh(others, first)
        farthest = max(_farthest(first, second, points, there), _farthest(second, first, others, back))
        return cls(there, back, farthest, (first.area, second.area))

    @property
    def figures(self) -> dict[str, float]:
        """What `surface_distances` returns."""
        return {
            "assd": float(self.there.sum() + self.back.sum()) / (len(self.there) + len(self.back)),
            "hd95": float(max(np.percentile(self.there, 95), np.percentile(self.back, 95))),
            "hausdorff": self.farthest,
        }

    def surface_dice(self, tolerance: float) -> float:
        """Share of both surfaces that lies within a tolerance in mm of the other (Nikolov et al. 2021)."""
        within = [float(np.mean(part <= tolerance)) for part in (self.there, self.back)]
        return float(np.average(within, weights=self.areas))


def surface_distances(
    first: Mesh, second: Mesh, rng: np.random.Generator, count: int = 50_000
) -> dict[str, float]:
    """Distances in mm between two meshes, both ways, from area-uniform points to the other's triangles.

    Returns
    -------
    dict
        ``assd`` (average symmetric surface distance), ``hd95`` (the larger of the two 95th
        percentiles) and ``hausdorff`` (the largest distance met, vertices included).
    """
    return Gaps.between(first, second, rng, count).figures


def _farthest(mesh: Mesh, other: Mesh, points: FloatArray, distances: FloatArray) -> float:
    """Largest distance to another mesh, of points (P, 3) whose distances (P,) are known, and of vertices."""
    far = float(distances.max())
    away, nearest = scipy.spatial.cKDTree(points).query(mesh.vertices)
    further = mesh.vertices[distances[nearest] + away > far]  # no others can be: a step away is a step more
    return max(far, float(unsigned_to_mesh(further, other).max())) if len(further) else far


def normal_angles(mesh: Mesh, truth: Mesh, rng: np.random.Generator, *, is_smooth: bool = True) -> np.ndarray:
    """Angles (N,) in degrees between a mesh's normals and the true surface's at the nearest points.

    Points are uniform by area of the truth. A mesh's normal is that of the face nearest to the point; the
    true surface's is between those of its vertices, because its own faces are coarser than its shape. Where
    it is not ``is_smooth``, but a mesh like the other, its normal is its face's: equal meshes agree.
    """
    face = rng.choice(len(truth.faces), ANGLES, p=truth.face_areas / truth.area)
    weights = rng.dirichlet(np.ones(3), ANGLES)
    points = np.einsum("pc,pcx->px", weights, truth.vertices[truth.faces[face]])
    at_corners = truth.vertex_normals[truth.faces[face]] if is_smooth else truth.unit_normals[face][:, None]
    true = (weights[..., None] * at_corners).sum(axis=1)
    nearest = mesh.unit_normals[nearest_faces(points, mesh)]
    across = np.linalg.norm(np.cross(true, nearest), axis=1)
    return np.degrees(np.arctan2(across, np.einsum("px,px->p", true, nearest)))
