"""Single triangles, in compiled functions: their corners, and how far points are from them."""

from __future__ import annotations

from cccd.geometry._jit import jit_within
from cccd.geometry.arrays import FloatArray, IntArray

__all__ = ["Point", "corners_of", "dot", "point_of", "squared_distance"]

Point = tuple[float, float, float]


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
