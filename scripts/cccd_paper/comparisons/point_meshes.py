"""Surfaces from the curves' points alone, as the paper's introduction names them: [3], [4], [5].

Open3D (extra ``comparisons``) makes them; without it they have no row. Every function accepts the curves and
returns a mesh in world mm (RAS). What the methods leave open or tangled is left so: that is part of the
comparison.
"""

from __future__ import annotations

from importlib.util import find_spec
from typing import Any

import numpy as np

from cccd.containers import Curves
from cccd.geometry.mesh import Mesh

#: The package that makes them.
OPEN3D = "open3d"

#: From a grid on training phantoms: depth of the octree, and radii as multiples of the larger of slice step
#: and pixel.
OCTREE_DEPTH = 8
BALLS = (2.0, 4.0)
ALPHA = 2.0


def has_open3d() -> bool:
    """Whether the optional package is there that makes surfaces from points."""
    return find_spec(OPEN3D) is not None


def alpha_shape(curves: Curves) -> Mesh:
    """Alpha shape (Edelsbrunner and Mücke 1994): of points on a surface alone it is a hollow shell."""
    open3d, cloud, step = _cloud(curves)
    return _mesh(open3d.geometry.TriangleMesh.create_from_point_cloud_alpha_shape(cloud, ALPHA * step))


def ball_pivoting(curves: Curves) -> Mesh:
    """Ball pivoting (Bernardini et al. 1999): the triangles that a ball walks over."""
    open3d, cloud, step = _cloud(curves)
    radii = open3d.utility.DoubleVector([radius * step for radius in BALLS])
    return _mesh(open3d.geometry.TriangleMesh.create_from_point_cloud_ball_pivoting(cloud, radii))


def poisson(curves: Curves) -> Mesh:
    """Poisson surface reconstruction (Kazhdan et al. 2006)."""
    open3d, cloud, _ = _cloud(curves)
    made, _ = open3d.geometry.TriangleMesh.create_from_point_cloud_poisson(
        cloud, depth=OCTREE_DEPTH, n_threads=1
    )
    return _mesh(made)


def _cloud(curves: Curves) -> tuple[Any, Any, float]:
    """Open3D, the curves' points and normals as it takes them, and the larger of slice step and pixel."""
    import open3d  # pyright: ignore[reportMissingImports]

    points, normals = _points_and_normals(curves)
    facing = np.linalg.norm(normals, axis=1) > 0
    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points[facing]))
    cloud.normals = open3d.utility.Vector3dVector(normals[facing])
    return open3d, cloud, max(_slice_step(curves), float(curves.frame.pixel_spacing.max()))


def _mesh(made: Any) -> Mesh:
    return Mesh(np.asarray(made.vertices), np.asarray(made.triangles).astype(np.int64))


def _slice_step(curves: Curves) -> float:
    """Distance in mm of neighbouring slices that hold a curve, most often."""
    gaps = np.diff(np.unique(curves.slice))
    return (float(np.median(gaps)) if len(gaps) else 1.0) * curves.frame.slice_spacing


def _points_and_normals(curves: Curves) -> tuple[np.ndarray, np.ndarray]:
    """World points (P, 3) of the curves and their outward unit normals in the slice's plane."""
    ahead = np.concatenate([np.roll(curve, -2, axis=0) for curve in curves])
    behind = np.concatenate([np.roll(curve, 2, axis=0) for curve in curves])
    k = np.repeat(curves.slice, np.diff(curves.offsets))
    tangent = ahead - behind
    normal = np.column_stack([tangent[:, 1], -tangent[:, 0]])
    frame = curves.frame
    points = frame.to_world(curves.points, k)
    # A normal is a covector: it goes to the world by the inverse spacing along the axes' directions.
    direction = frame.stack_affine[:3, :2] / frame.pixel_spacing
    normals = (normal / frame.pixel_spacing) @ direction.T
    size = np.linalg.norm(normals, axis=1, keepdims=True)
    return points, np.divide(normals, size, out=np.zeros_like(normals), where=size > 0)
