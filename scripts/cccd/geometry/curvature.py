"""Mean curvature of a mesh."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from cccd.geometry.arrays import FloatArray
from cccd.geometry.mesh import Mesh

__all__ = ["mean_curvature"]


def mean_curvature(mesh: Mesh, at: FloatArray) -> FloatArray:
    """Estimate the mean curvature (P,) in 1/mm near the points ``at`` (P, 3); positive is convex.

    Discrete mean curvature at the vertices, the median of the twelve that lie nearest to each point: the
    second derivative of a triangulation is noisy at the scale of its triangles.
    """
    values = np.asarray(mesh.to_polydata().curvature("mean"))
    _, nearest = cKDTree(mesh.vertices).query(at, k=min(12, len(mesh.vertices)))
    return np.median(values[nearest.reshape(len(at), -1)], axis=1)
