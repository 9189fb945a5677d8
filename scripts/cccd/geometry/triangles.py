"""Single triangles: how far points are from them, where, and where lines meet them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cccd.geometry._jit import jit_within
from cccd.geometry.arrays import BoolArray, FloatArray, IntArray
from cccd.tolerances import TINY

__all__ = ["Feet", "Point", "corners_of", "dot", "feet_on", "met_at", "point_of", "squared_distance"]

Point = tuple[float, float, float]


class Feet(NamedTuple):
    """Points on triangles (P, 3, 3) that are nearest to other points."""

    places: FloatArray  # (P, 3)
    edge: IntArray  # (P,) the triangle's edge, from corner n to the next, on which it lies; -1 amid it
    share: FloatArray  # (P,) of that edge: 0 and 1 its corners


def feet_on(corners: FloatArray, points: FloatArray) -> Feet:
    """Find the points of triangles (P, 3, 3) that are nearest to points (P, 3)."""
    along = np.roll(corners, -1, axis=1) - corners
    away = points[:, None] - corners
    length2 = np.einsum("pec,pec->pe", along, along)
    share = np.clip(np.einsum("pec,pec->pe", away, along) / np.maximum(length2, TINY), 0, 1)
    places = corners + share[:, :, None] * along
    rows = np.arange(len(points))
    edge = np.argmin(((points[:, None] - places) ** 2).sum(axis=2), axis=1)
    normal = np.cross(along[:, 0], along[:, 1])
    size2 = (normal**2).sum(axis=1)
    within: BoolArray = np.all(np.einsum("pec,pc->pe", np.cross(along, away), normal) > 0, axis=1) & (
        size2 > 0
    )
    drop = np.einsum("pc,pc->p", away[:, 0], normal) / np.where(size2 > 0, size2, 1.0)
    dropped: FloatArray = points - drop[:, None] * normal
    return Feet(
        np.where(within[:, None], dropped, places[rows, edge]), np.where(within, -1, edge), share[rows, edge]
    )


@jit_within
def met_at(start: Point, way: Point, a: Point, b: Point, c: Point) -> float:
    """Share of a way at which it meets a triangle (Moeller and Trumbore 1997); infinity where it does not."""
    ab, ac, apart = _along(b, -1.0, a), _along(c, -1.0, a), _along(start, -1.0, a)
    across = _cross(way, ac)
    volume = dot(ab, across)
    if volume == 0:
        return np.inf
    over = _cross(apart, ab)
    u, v = dot(apart, across) / volume, dot(way, over) / volume
    at = dot(ac, over) / volume
    return at if u >= 0 and v >= 0 and u + v <= 1 and at >= 0 else np.inf


@jit_within
def _cross(a: Point, b: Point) -> Point:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@jit_within
def point_of(vertices: FloatArray, n: int) -> Point:
    """Return row ``n`` of points (V, 3)."""
    return (vertices[n, 0], vertices[n, 1], vertices[n, 2])


@jit_within
def corners_of(vertices: FloatArray, faces: IntArray, f: int) -> tuple[Point, Point, Point]:
    """Return the corners of face ``f``."""
    return point_of(vertices, faces[f, 0]), point_of(vertices, faces[f, 1]), point_of(vertices, faces[f, 2])


@jit_within
def _along(a: Point, share: float, b: Point) -> Point:
    """Return ``a + share * b``."""
    return (a[0] + share * b[0], a[1] + share * b[1], a[2] + share * b[2])


@jit_within
def dot(a: Point, b: Point) -> float:
    """Return the scalar product of two directions."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@jit_within
def squared_distance(point: Point, a: Point, b: Point, c: Point) -> float:
    """Squared distance from a point to a triangle (Ericson 2005, section 5.1.5)."""
    ab, ac, ap = _along(b, -1.0, a), _along(c, -1.0, a), _along(point, -1.0, a)
    d1, d2 = dot(ab, ap), dot(ac, ap)
    if d1 <= 0 and d2 <= 0:
        return dot(ap, ap)
    bp = _along(point, -1.0, b)
    d3, d4 = dot(ab, bp), dot(ac, bp)
    if d3 >= 0 and d4 <= d3:
        return dot(bp, bp)
    if d1 * d4 - d3 * d2 <= 0 and d1 >= 0 and d3 <= 0 and d1 > d3:
        rest = _along(ap, -d1 / (d1 - d3), ab)
        return dot(rest, rest)
    cp = _along(point, -1.0, c)
    d5, d6 = dot(ab, cp), dot(ac, cp)
    if d6 >= 0 and d5 <= d6:
        return dot(cp, cp)
    if d5 * d2 - d1 * d6 <= 0 and d2 >= 0 and d6 <= 0 and d2 > d6:
        rest = _along(ap, -d2 / (d2 - d6), ac)
        return dot(rest, rest)
    if d3 * d6 - d5 * d4 <= 0 and d4 >= d3 and d5 >= d6 and d4 - d3 + d5 - d6 > 0:
        rest = _along(bp, -(d4 - d3) / (d4 - d3 + d5 - d6), _along(c, -1.0, b))
        return dot(rest, rest)
    x = ab[1] * ac[2] - ab[2] * ac[1]
    y = ab[2] * ac[0] - ab[0] * ac[2]
    z = ab[0] * ac[1] - ab[1] * ac[0]
    size = x * x + y * y + z * z
    return (ap[0] * x + ap[1] * y + ap[2] * z) ** 2 / size if size > 0 else dot(ap, ap)
