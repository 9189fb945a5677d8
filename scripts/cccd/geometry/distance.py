"""Signed distances, negative inside: to masks, polygons and meshes, at points and on grids."""

from __future__ import annotations

from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import scipy

from cccd.geometry._igl import igl
from cccd.geometry._jit import jit, jit_within
from cccd.geometry.arrays import BoolArray, FloatArray, IntArray, SingleArray
from cccd.geometry.grid import ScalarGrid
from cccd.geometry.mesh import Mesh
from cccd.geometry.opencv import distance_to_zero
from cccd.geometry.polygons import RaggedPolygons
from cccd.geometry.raster import voxelise

__all__ = [
    "grid_to_mesh",
    "nearest_faces",
    "nearest_points",
    "to_mask",
    "to_mesh",
    "to_polygons",
    "unsigned_to_mesh",
]

#: Boxes around the triangles of a mesh, kept while it is: they take longer to make than to ask.
_TREES: WeakKeyDictionary[Mesh, Any] = WeakKeyDictionary()
#: Distances to polygons are exact within this many pixels of them.
NEAR_PIXELS = 2.0
#: Nodes of a grid are looked at in cubes of so many along each side: only those near a mesh.
_BLOCK = 3

# Of the plane -----------------------------------------------------------------------------------------


def to_mask(mask: BoolArray, spacing: FloatArray) -> SingleArray:
    """Signed distance of every pixel (I, J) to the border midway between centres inside and outside.

    Parameters
    ----------
    mask : (I, J) bool
        With at least one pixel inside and one outside.
    spacing : (2,) float64
        Edge lengths of a pixel along i and j.

    Examples
    --------
    >>> to_mask(np.array([[False, False, True, True]]), np.ones(2)).tolist()
    [[1.5, 0.5, -0.5, -1.5]]
    """
    if abs(spacing[0] - spacing[1]) <= 1e-3 * spacing[1]:
        mask = np.ascontiguousarray(mask)
        inwards, outwards = (distance_to_zero(side, exact=True) for side in (mask, ~mask))
        return np.where(mask, 0.5 - inwards, outwards - 0.5) * np.float32(spacing.mean())
    half = float(spacing.min()) / 2  # neighbours along the finer axis decide where most borders lie
    to_border = scipy.ndimage.distance_transform_edt
    inwards, outwards = (to_border(side, sampling=spacing) for side in (mask, ~mask))
    return np.asarray(np.where(mask, half - inwards, outwards - half), np.float32)


def to_polygons(inside: BoolArray, polygons: RaggedPolygons, spacing: FloatArray) -> SingleArray:
    """Signed distance of every pixel (I, J) to the nearest of some polygons.

    Parameters
    ----------
    inside : (I, J) bool
        Pixels whose centres the polygons enclose.
    polygons : RaggedPolygons
        In mm from the centre of the first pixel; at least one.
    spacing : (2,) float64
        Edge lengths of a pixel in mm.

    Notes
    -----
    Pixels near a polygon find the nearest point on it; sweeps down and up the plane hand these points on, and
    each pixel keeps the nearest that it is offered (Danielsson 1980, with points between the pixels).

    Examples
    --------
    >>> square = RaggedPolygons.of([np.array([(1.0, 1), (3, 1), (3, 3), (1, 3)])])
    >>> inside = np.zeros((5, 5), bool)
    >>> inside[1:4, 1:4] = True
    >>> to_polygons(inside, square, np.ones(2))[2].tolist()
    [1.0, 0.0, -1.0, 0.0, 1.0]
    """
    foot, gap = np.full((*inside.shape, 2), np.inf), np.full(inside.shape, np.inf)
    _find_nearby(polygons.points, polygons.offsets, spacing, foot, gap)
    _sweep(foot, gap, spacing)
    away = np.sqrt(gap).astype(np.float32)
    return np.where(inside & (away > 0), -away, away)


@jit
def _sweep(foot: FloatArray, gap: FloatArray, spacing: FloatArray) -> None:
    """Hand the nearest points on, down and up the plane."""
    height = len(gap)
    for way in (1, -1):
        for step in range(height):
            i = step if way > 0 else height - 1 - step
            if 0 <= i - way < height:
                for side in (-1, 0, 1):
                    _take_over(foot, gap, i, i - way, side, spacing)
            for side in (-1, 1):
                _take_over(foot, gap, i, i, side, spacing)


@jit
def _find_nearby(
    points: FloatArray, offsets: IntArray, spacing: FloatArray, foot: FloatArray, gap: FloatArray
) -> None:
    """Write the nearest point and its squared distance, for pixels near a polygon's edges."""
    height, width = gap.shape
    for polygon in range(len(offsets) - 1):
        first, last = offsets[polygon], offsets[polygon + 1]
        for n in range(first, last):
            after = n + 1 if n + 1 < last else first
            ax, ay, bx, by = points[n, 0], points[n, 1], points[after, 0], points[after, 1]
            dx, dy = bx - ax, by - ay
            length2 = dx * dx + dy * dy
            i0 = max(0, int(np.ceil(min(ax, bx) / spacing[0] - NEAR_PIXELS)))
            i1 = min(height - 1, int(max(ax, bx) / spacing[0] + NEAR_PIXELS))
            j0 = max(0, int(np.ceil(min(ay, by) / spacing[1] - NEAR_PIXELS)))
            j1 = min(width - 1, int(max(ay, by) / spacing[1] + NEAR_PIXELS))
            for i in range(i0, i1 + 1):
                px = i * spacing[0] - ax
                for j in range(j0, j1 + 1):
                    py = j * spacing[1] - ay
                    share = 0.0
                    if length2 > 0:
                        share = min(1.0, max(0.0, (px * dx + py * dy) / length2))
                    ex, ey = px - share * dx, py - share * dy
                    if ex * ex + ey * ey < gap[i, j]:
                        gap[i, j] = ex * ex + ey * ey
                        foot[i, j, 0], foot[i, j, 1] = ax + share * dx, ay + share * dy


@jit_within
def _take_over(foot: FloatArray, gap: FloatArray, i: int, a: int, side: int, spacing: FloatArray) -> None:
    """Let the pixels of row ``i`` take over nearer points from row ``a``, ``side`` columns beside them."""
    # A row at a time, because to hand arrays on costs more than to compare two distances.
    width = gap.shape[1]
    for n in range(width - abs(side)):
        j = width - 2 - n if side > 0 else n - side
        b = j + side
        if gap[a, b] < np.inf:
            x, y = i * spacing[0] - foot[a, b, 0], j * spacing[1] - foot[a, b, 1]
            if x * x + y * y < gap[i, j]:
                gap[i, j] = x * x + y * y
                foot[i, j, 0], foot[i, j, 1] = foot[a, b, 0], foot[a, b, 1]


# Of meshes --------------------------------------------------------------------------------------------


def nearest_faces(points: FloatArray, mesh: Mesh) -> IntArray:
    """Faces (P,) of a mesh that are nearest to points (P, 3)."""
    return _nearest(points, mesh)[1]


def nearest_points(points: FloatArray, mesh: Mesh) -> FloatArray:
    """Points (P, 3) on a mesh, open or closed, that are nearest to points (P, 3)."""
    return _nearest(points, mesh)[2]


def unsigned_to_mesh(points: FloatArray, mesh: Mesh) -> FloatArray:
    """Distance (P,) of points (P, 3) to the nearest point on a mesh, open or closed."""
    return np.sqrt(_nearest(points, mesh)[0])


def _nearest(points: FloatArray, mesh: Mesh) -> tuple[FloatArray, IntArray, FloatArray]:
    """Squared distances (P,), faces (P,) and places (P, 3) of the nearest points on a mesh."""
    if (tree := _TREES.get(mesh)) is None:
        tree = _TREES[mesh] = igl.AABB()
        tree.init(mesh.vertices, mesh.faces)
    return tree.squared_distance(mesh.vertices, mesh.faces, np.asarray(points, float))


def to_mesh(points: FloatArray, mesh: Mesh) -> FloatArray:
    """Signed distance (P,) of points (P, 3) to a closed mesh, positive outside.

    The sign is that of the pseudonormal at the nearest point (Baerentzen and Aanaes 2005).
    """
    kind = igl.SIGNED_DISTANCE_TYPE_PSEUDONORMAL
    return igl.signed_distance(np.asarray(points, float), mesh.vertices, mesh.faces, kind)[0]


def grid_to_mesh(
    mesh: Mesh, origin: FloatArray, spacing: float, shape: tuple[int, int, int], band: float
) -> ScalarGrid:
    """Signed distance to a closed mesh at the nodes of a grid, cut off at a band to either side of it.

    Parameters
    ----------
    mesh : Mesh
        It may pass through itself.
    origin, spacing, shape
        The grid: its first node (3,), the distance between nodes, and their number (A, B, C).
    band : float
        Distances are kept up to this many nodes.

    Returns
    -------
    ScalarGrid
        float32, in the unit of the mesh.
    """
    grid = ScalarGrid.uniform(np.full(shape, band * spacing, np.float32), origin, spacing)
    blocks = np.argwhere(np.ones([-(-n // _BLOCK) for n in shape], np.bool_)) * _BLOCK
    middle = unsigned_to_mesh(origin + spacing * (blocks + (_BLOCK - 1) / 2), mesh)
    blocks = blocks[middle < spacing * (band + _BLOCK * 3**0.5 / 2)]
    for step in np.ndindex(_BLOCK, _BLOCK, _BLOCK):
        nodes = blocks + step
        nodes = nodes[np.all(nodes < shape, axis=1)]
        grid.values[tuple(nodes.T)] = np.minimum(
            unsigned_to_mesh(origin + spacing * nodes, mesh), band * spacing
        )
    np.negative(grid.values, out=grid.values, where=voxelise(mesh, grid.affine, shape))
    return grid
