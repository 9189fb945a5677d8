"""Surfaces from the curves' points alone, as the paper's introduction names them: [3], [4], [5].

Every function accepts the curves and returns a mesh in world mm (RAS). What the methods leave
open or tangled is left so: that is part of the comparison. Open3D makes them where it is installed (extra
``comparisons``), at settings from a grid on training phantoms; else what stands here does.
"""

from __future__ import annotations

from importlib.util import find_spec
from typing import Any

import numpy as np
import pyvista as pv
from scipy import fft, ndimage
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import Delaunay

from cccd.comparisons.volume_meshes import from_polydata
from cccd.containers import Curves
from cccd.geometry.mesh import Mesh

__all__ = ["alpha_shape", "ball_pivoting", "poisson"]

#: Points that a Delaunay tetrahedralisation gets, at most: every n-th is taken beyond that.
MOST_POINTS = 30_000
#: Radius of balls and alpha shapes as a multiple of the larger of slice step and point spacing.
BALL_RADII = 1.25
#: Cells along the longest side of the grid of the Poisson equation.
POISSON_CELLS = 144


#: Open3D's: depth of the octree, and radii as multiples of the larger of slice step and pixel.
OCTREE_DEPTH = 8
OPEN3D_BALLS = (2.0, 4.0)
OPEN3D_ALPHA = 2.0


def has_open3d() -> bool:
    """Whether the optional package is there that makes surfaces from points."""
    return find_spec("open3d") is not None


def _open3d_cloud(curves: Curves) -> tuple[Any, Any, float]:
    """Open3D, the curves' points and normals as it takes them, and the larger of slice step and pixel."""
    import open3d  # pyright: ignore[reportMissingImports]

    points, normals = _points_and_normals(curves)
    facing = np.linalg.norm(normals, axis=1) > 0
    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points[facing]))
    cloud.normals = open3d.utility.Vector3dVector(normals[facing])
    return open3d, cloud, max(_slice_step(curves), float(curves.frame.pixel_spacing.max()))


def _from_open3d(mesh: Any) -> Mesh:
    return Mesh(np.asarray(mesh.vertices), np.asarray(mesh.triangles).astype(np.int64))


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


def _thinned(curves: Curves) -> tuple[np.ndarray, np.ndarray, float]:
    """Points, normals and the ball radius in mm, thinned to what Delaunay can take."""
    points, normals = _points_and_normals(curves)
    every = max(1, -(-len(points) // MOST_POINTS))
    radius = BALL_RADII * max(_slice_step(curves), every * float(curves.frame.pixel_spacing.max()))
    # Points on a grid are degenerate for Delaunay: a thousandth of a voxel of seeded jitter decides.
    jitter = np.random.default_rng(0).normal(scale=1e-3 * radius, size=points.shape)
    return (points + jitter)[::every], normals[::every], radius


def _circumcentres(corners: np.ndarray) -> np.ndarray:
    """Centres (T, 3) of the circumspheres of tetrahedra (T, 4, 3)."""
    edges = corners[:, 1:] - corners[:, :1]
    right = 0.5 * np.sum(edges**2, axis=2)
    edges[np.abs(np.linalg.det(edges)) < 1e-12] = np.eye(3)
    return corners[:, 0] + np.linalg.solve(edges, right[..., None])[..., 0]


#: Faces of a tetrahedron, each opposite to the corner of the same number.
_OPPOSITE = np.array([[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]])


def alpha_shape(curves: Curves) -> Mesh:
    """Outer boundary of the alpha shape (Edelsbrunner and Mücke 1994).

    A ball that comes from outside passes through triangles of larger circumradius only; what it cannot
    reach is the solid. (The alpha complex of points on a surface alone, Open3D's too, is a
    hollow shell.)
    """
    if has_open3d():
        open3d, cloud, step = _open3d_cloud(curves)
        return _from_open3d(
            open3d.geometry.TriangleMesh.create_from_point_cloud_alpha_shape(cloud, OPEN3D_ALPHA * step)
        )
    points, _, radius = _thinned(curves)
    net = Delaunay(points)
    count = len(net.simplices)
    tetrahedron, corner = np.repeat(np.arange(count), 4), np.tile(np.arange(4), count)
    across = net.neighbors.ravel()
    faces = net.simplices[tetrahedron[:, None], _OPPOSITE[corner]]
    open_faces = _circumradii(points, faces) > radius
    outside = count  # a node for all space around the points
    linked = np.where(across < 0, outside, across)
    graph = coo_array(
        (np.ones(int(open_faces.sum()), bool), (tetrahedron[open_faces], linked[open_faces])),
        shape=(count + 1, count + 1),
    )
    _, labels = connected_components(graph, directed=False)
    solid = labels != labels[outside]
    chosen = solid[tetrahedron] & ~solid[linked]
    apex = points[net.simplices[tetrahedron, corner]]
    return Mesh(points, _facing_away(points, faces[chosen], apex[chosen])).compact()


def _circumradii(points: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Circumradii (F,) of triangles, infinite for flat ones."""
    a, b, c = (points[faces[:, n]] for n in range(3))
    area2 = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    lengths = np.stack([np.linalg.norm(x - y, axis=1) for x, y in ((a, b), (b, c), (c, a))])
    return np.divide(lengths.prod(axis=0), 2 * area2, out=np.full(len(faces), np.inf), where=area2 > 0)


def ball_pivoting(curves: Curves) -> Mesh:
    """Triangles on which a ball rests from outside (Bernardini et al. 1999).

    A ball of radius r rests on three points when it touches them and holds no other: its centre lies on
    the Voronoi edge of a Delaunay triangle. Pivoting walks from one such triangle to the next; taking
    all of them on the outer side of the points gives the surface that it walks over.
    """
    if has_open3d():
        open3d, cloud, step = _open3d_cloud(curves)
        radii = open3d.utility.DoubleVector([radius * step for radius in OPEN3D_BALLS])
        return _from_open3d(open3d.geometry.TriangleMesh.create_from_point_cloud_ball_pivoting(cloud, radii))
    points, normals, radius = _thinned(curves)
    net = Delaunay(points)
    centre = _circumcentres(points[net.simplices])
    count = len(net.simplices)
    tetrahedron = np.repeat(np.arange(count), 4)
    corner = np.tile(np.arange(4), count)
    across = net.neighbors.ravel()
    faces = net.simplices[tetrahedron[:, None], _OPPOSITE[corner]]
    a, b, c = (points[faces[:, n]] for n in range(3))
    normal = np.cross(b - a, c - a)
    area2 = np.linalg.norm(normal, axis=1)
    outward = np.sum(normals[faces], axis=1)
    facing = np.einsum("fc,fc->f", normal, outward)
    circumradius = _circumradii(points, faces)
    unit = normal / np.maximum(area2, 1e-12)[:, None] * np.sign(facing)[:, None]
    rests = (circumradius < radius) & (facing != 0)
    height = np.sqrt(np.maximum(radius**2 - np.minimum(circumradius, radius) ** 2, 0))
    apex = points[net.simplices[tetrahedron, corner]]
    on_apex_side = np.einsum("fc,fc->f", apex - a, unit) > 0
    here = np.einsum("fc,fc->f", centre[tetrahedron] - a, unit)
    there = np.einsum("fc,fc->f", centre[across] - a, unit)
    there[across < 0] = np.where(on_apex_side[across < 0], -np.inf, np.inf)
    low, high = np.minimum(here, there), np.maximum(here, there)
    rests &= (low <= height) & (height <= high)
    rests &= (across < 0) | (tetrahedron < across)  # an inner triangle is met from both sides
    chosen = faces[rests]
    flip = facing[rests] < 0
    chosen[flip] = chosen[flip][:, ::-1]
    return Mesh(points, chosen.astype(np.int64)).compact()


def poisson(curves: Curves) -> Mesh:
    """Poisson surface reconstruction (Kazhdan et al. 2006) on a regular grid, solved by FFT.

    The indicator's Laplacian is the divergence of the smoothed normal field; its level is the mean at
    the points.
    """
    if has_open3d():
        open3d, cloud, _ = _open3d_cloud(curves)
        made, _ = open3d.geometry.TriangleMesh.create_from_point_cloud_poisson(
            cloud, depth=OCTREE_DEPTH, n_threads=1
        )
        return _from_open3d(made)
    points, normals = _points_and_normals(curves)
    low, high = points.min(axis=0), points.max(axis=0)
    cell = float((high - low).max()) / POISSON_CELLS
    gap = np.unique(curves.slice)
    step = float(np.median(np.diff(gap))) * curves.frame.slice_spacing if len(gap) > 1 else cell
    cell = max(cell, step / 2)  # slices further apart than the cells would leave holes in the field
    low = low - 8 * cell
    shape = tuple(fft.next_fast_len(int(size), real=True) for size in np.ceil((high + 8 * cell - low) / cell))
    index = (points - low) / cell
    field = np.zeros((3, *shape))
    weight = np.zeros(shape)
    base = np.floor(index).astype(np.int64)
    share = index - base
    for corner in np.ndindex(2, 2, 2):
        part = np.prod(np.where(corner, share, 1 - share), axis=1)
        at = tuple((base + corner).T)
        np.add.at(weight, at, part)
        for axis in range(3):
            np.add.at(field[axis], at, part * normals[:, axis])
    width = 1.0 + 0.5 * step / cell
    density = ndimage.gaussian_filter(weight, width)
    field = np.stack([ndimage.gaussian_filter(component, width) for component in field])
    field /= np.maximum(density, 1e-3 * density.max())
    field *= np.minimum(1.0, density / (0.2 * density.max()))
    waves = np.meshgrid(
        *(2 * np.pi * np.fft.fftfreq(size) for size in shape[:2]),
        2 * np.pi * np.fft.rfftfreq(shape[2]),
        indexing="ij",
    )
    squared = np.sum([wave**2 for wave in waves], axis=0)
    squared[0, 0, 0] = 1.0
    divergence = sum(1j * wave * fft.rfftn(part) for wave, part in zip(waves, field, strict=True))
    indicator = fft.irfftn(-divergence / squared, s=shape)
    level = float(ndimage.map_coordinates(indicator, index.T, order=1).mean())
    border = indicator[0].mean()
    for axis in range(3):  # close the surface inside the grid
        np.moveaxis(indicator, axis, 0)[[0, -1]] = border
    grid = pv.ImageData(dimensions=shape, spacing=(cell,) * 3, origin=low)
    grid.point_data["indicator"] = indicator.ravel(order="F")
    return from_polydata(grid.contour([level], scalars="indicator", method="flying_edges")).outwards()


def _facing_away(points: np.ndarray, faces: np.ndarray, behind: np.ndarray) -> np.ndarray:
    """Turn faces (F, 3) so that the points ``behind`` (F, 3) lie on their inner side."""
    a, b, c = (points[faces[:, n]] for n in range(3))
    inner = np.einsum("fc,fc->f", np.cross(b - a, c - a), behind - a) > 0
    faces = faces.copy()
    faces[inner] = faces[inner][:, ::-1]
    return faces
