"""Rings: the closed contours of a level's field, and how rings of neighbouring levels overlap."""

from __future__ import annotations

from dataclasses import dataclass, field

import contourpy
import cv2
import numpy as np
from numba import njit

from cccd.surface.fields import Field

__all__ = ["Ring", "overlap", "resample", "rings_of", "signed_area"]


@dataclass(eq=False)
class Ring:
    """One closed contour of one level.

    Attributes
    ----------
    level : int
        Position of the level in the stack, from 0.
    z : float
        Height in mm.
    points : (n, 2) float64
        mm in the plane, counter-clockwise whether outline or hole, first point not repeated.
    hole : bool
        Whether the ring bounds a hole.
    area : float
        mm^2 that the ring stands for: that of the pixels inside, or of the polygon.
    source_slice : int or None
        The source slice that it lies on.
    depth : int
        How many rings of its level surround it: 0 outline, 1 hole, 2 island in a hole, ...
    mask, corner
        Pixels with their centre inside, in the ring's bounding box from pixel ``corner`` (2,).
    """

    level: int
    z: float
    points: np.ndarray
    hole: bool
    area: float
    source_slice: int | None
    depth: int
    mask: np.ndarray = field(repr=False)
    corner: np.ndarray = field(repr=False)


def signed_area(points: np.ndarray) -> float:
    """Shoelace area of a polygon (n, 2)."""
    x, y = points[:, 0] - points[0, 0], points[:, 1] - points[0, 1]
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


def resample(points: np.ndarray, count: int) -> np.ndarray:
    """``count`` points at equal steps of arc length along a closed polygon (n, 2)."""
    closed = np.vstack([points, points[:1]])
    length = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(closed, axis=0).T))])
    at = np.arange(count) * (length[-1] / count)
    return np.column_stack([np.interp(at, length, closed[:, 0]), np.interp(at, length, closed[:, 1])])


@njit(cache=True)
def _fill(points, height, width):
    """Pixels (H, W) whose centres a closed polygon in pixel units encloses (even-odd)."""
    mask = np.zeros((height, width), np.uint8)
    count = len(points)
    for n in range(count):
        a, b = points[n], points[(n + 1) % count]
        if a[0] > b[0]:
            a, b = b, a
        for i in range(max(0, int(np.ceil(a[0]))), min(height, int(np.ceil(b[0])))):
            j = a[1] + (i - a[0]) / (b[0] - a[0]) * (b[1] - a[1])
            for column in range(max(0, int(np.ceil(j))), width):
                mask[i, column] ^= 1
    return mask


def rings_of(field: Field, level: int, spacing: np.ndarray, of_pixels: bool) -> list[Ring]:
    """Every closed contour of a field at distance zero, largest first.

    Parameters
    ----------
    field : Field
        Positive along its border.
    level : int
        The field's position in the stack.
    spacing : (2,) float64
        mm per pixel along i and j.
    of_pixels : bool
        Take a ring's area from the pixels it encloses instead of from its polygon.
    """
    lines = contourpy.contour_generator(z=field.distance).lines(0.0)
    rings = []
    for line in lines:
        pixels = line[:-1, ::-1]
        keep = np.any(np.abs(pixels - np.roll(pixels, 1, axis=0)) > 1e-6, axis=1)
        pixels = np.ascontiguousarray(pixels[keep])
        if len(pixels) < 3:
            continue
        area = signed_area(pixels)
        corner = np.floor(pixels.min(axis=0)).astype(np.int64)
        extent = np.ceil(pixels.max(axis=0)).astype(np.int64) - corner + 1
        mask = _fill(pixels - corner, extent[0], extent[1])
        count = int(np.count_nonzero(mask))
        if count == 0:
            continue
        hole = area < 0
        points = (pixels if area > 0 else pixels[::-1]) * spacing
        stands_for = (count if of_pixels else abs(area)) * spacing[0] * spacing[1]
        rings.append(
            Ring(level, field.z, points, hole, float(stands_for), field.source_slice, 0, mask, corner)
        )
    rings.sort(key=lambda ring: -ring.area)
    for n, ring in enumerate(rings):
        ring.depth = sum(_surrounds(larger, ring) for larger in rings[:n])
    return rings


def _surrounds(outer: Ring, inner: Ring) -> bool:
    low, high = outer.corner, outer.corner + outer.mask.shape
    if np.any(inner.corner < low) or np.any(inner.corner + inner.mask.shape > high):
        return False
    x, y = (float(value) for value in inner.points[0])
    return cv2.pointPolygonTest(outer.points.astype(np.float32)[:, None], (x, y), False) > 0


def overlap(first: Ring, second: Ring) -> int:
    """Count the pixels that lie inside both rings."""
    low = np.maximum(first.corner, second.corner)
    high = np.minimum(first.corner + first.mask.shape, second.corner + second.mask.shape)
    if np.any(high <= low):
        return 0
    views = []
    for ring in (first, second):
        a, b = low - ring.corner, high - ring.corner
        views.append(ring.mask[a[0] : b[0], a[1] : b[1]])
    return int(np.count_nonzero(views[0] & views[1]))
