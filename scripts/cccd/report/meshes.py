"""Meshes made small for the page, and what colours them: distance to the reference, curvature."""

from __future__ import annotations

from typing import NamedTuple

import fast_simplification
import numpy as np
from scipy.spatial import cKDTree

from cccd.containers import Structure
from cccd.surface.measure import mask_surface

__all__ = [
    "Mesh",
    "mean_curvature",
    "outward",
    "reference_surface",
    "signed_distance",
    "simplify",
    "sort_spatially",
    "voxel_surface",
]


class Mesh(NamedTuple):
    """Triangles: ``points`` (V, 3) float64 in world mm (RAS), ``faces`` (F, 3) int64, normals outwards."""

    points: np.ndarray
    faces: np.ndarray


def _polydata(mesh: Mesh):
    import pyvista as pv

    return pv.PolyData.from_regular_faces(mesh.points, mesh.faces)


def voxel_surface(structure: Structure) -> Mesh | None:
    """Run marching cubes on the mask, as the surface stage measures against; None without a mask."""
    if structure.mask is None or not structure.mask.any():
        return None
    return Mesh(*mask_surface(structure))


def outward(points: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Turn the faces (F, 3) round when the volume that they enclose comes out negative."""
    a, b, c = (points[corner] - points.mean(axis=0) for corner in faces.T)
    volume = np.einsum("ij,ij->", a, np.cross(b, c))
    return faces if volume >= 0 else faces[:, ::-1]


def reference_surface(structure: Structure) -> tuple[Mesh, str] | None:
    """Find what the surface is measured against, and its name: analytic truth, else the mask's voxels."""
    if structure.truth is not None:
        points, faces = structure.truth
        return Mesh(points, outward(points, faces)), "the analytic surface"
    voxels = voxel_surface(structure)
    return None if voxels is None else (voxels, "the mask's voxel surface")


def simplify(mesh: Mesh, most: int) -> Mesh:
    """Collapse edges by quadric error (Garland and Heckbert 1997) to at most ``most`` triangles."""
    if len(mesh.faces) <= most:
        return mesh
    points, faces = fast_simplification.simplify(
        mesh.points.astype(np.float32), mesh.faces.astype(np.int32), target_count=most
    )
    return Mesh(np.asarray(points, float), np.asarray(faces, np.int64))


def sort_spatially(mesh: Mesh) -> tuple[Mesh, np.ndarray]:
    """Sort triangles along a Morton curve and vertices by first use, so that differences are small.

    Returns
    -------
    mesh : Mesh
    order : (V,) int
        Where each vertex stood before; unused vertices are dropped.
    """
    centroids = mesh.points[mesh.faces].mean(axis=1)
    low, extent = centroids.min(axis=0), np.ptp(centroids, axis=0).max() or 1.0
    cells = ((centroids - low) * (1023 / extent)).astype(np.uint32)
    key = np.zeros(len(cells), np.uint32)
    for bit in range(10):
        for axis in range(3):
            key |= ((cells[:, axis] >> bit) & 1) << np.uint32(3 * bit + axis)
    faces = mesh.faces[np.argsort(key, kind="stable")]
    used, first, inverse = np.unique(faces, return_index=True, return_inverse=True)
    by_use = np.argsort(first)
    rank = np.empty_like(by_use)
    rank[by_use] = np.arange(len(by_use))
    order = used[by_use]
    return Mesh(mesh.points[order], rank[inverse].reshape(-1, 3)), order


def signed_distance(points: np.ndarray, reference: Mesh) -> np.ndarray:
    """Measure the distance (P,) in mm of points to a closed mesh, positive outside."""
    import pyvista as pv

    measured = pv.PolyData(points).compute_implicit_distance(_polydata(reference))
    return np.asarray(measured["implicit_distance"])


def mean_curvature(mesh: Mesh, at: np.ndarray) -> np.ndarray:
    """Estimate the mean curvature (P,) in 1/mm near the points ``at`` (P, 3); positive is convex.

    Discrete mean curvature at the vertices, the median of the twelve that lie nearest to each point: the
    second derivative of a triangulation is noisy at the scale of its triangles.
    """
    values = np.asarray(_polydata(mesh).curvature("mean"))
    _, nearest = cKDTree(mesh.points).query(at, k=min(12, len(mesh.points)))
    return np.median(values[nearest.reshape(len(at), -1)], axis=1)
