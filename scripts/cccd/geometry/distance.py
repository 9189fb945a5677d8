"""Signed distances, negative inside: to masks, polygons and meshes."""

from __future__ import annotations

from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import scipy

from cccd.geometry.arrays import BoolArray, FloatArray, IntArray, SingleArray
from cccd.geometry.libigl import igl
from cccd.geometry.mesh import Mesh
from cccd.geometry.opencv import distance_to_zero
from cccd.geometry.polygons import RaggedPolygons

#: Boxes around the triangles of a mesh, kept while it is: they take longer to make than to ask.
_TREES: WeakKeyDictionary[Mesh, Any] = WeakKeyDictionary()


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

    Examples
    --------
    >>> square = RaggedPolygons.of([np.array([(1.0, 1), (3, 1), (3, 3), (1, 3)])])
    >>> inside = np.zeros((5, 5), bool)
    >>> inside[1:4, 1:4] = True
    >>> to_polygons(inside, square, np.ones(2))[2].tolist()
    [1.0, 0.0, -1.0, 0.0, 1.0]
    """
    pixels: FloatArray = np.moveaxis(np.indices(inside.shape), 0, -1).reshape(-1, 2) * spacing
    corners, places = (np.pad(points, ((0, 0), (0, 1))) for points in (polygons.points, pixels))
    sides = np.column_stack([np.arange(len(corners)), polygons.successors])
    tree = igl.AABB()
    tree.init(corners, sides)
    squared = tree.squared_distance(corners, sides, places)[0].reshape(inside.shape)
    away: SingleArray = np.sqrt(squared).astype(np.float32)
    return np.where(inside & (away > 0), -away, away)


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
