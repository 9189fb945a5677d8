"""Rings: the closed contours of a level's field, and how rings of neighbouring levels overlap."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import cv2
import numpy as np

from cccd.geometry._jit import jit
from cccd.geometry.arrays import ByteArray, FloatArray, IntArray
from cccd.geometry.contour_lines import zero_contours
from cccd.geometry.polygons import signed_area
from cccd.surface.fields import LevelField

__all__ = ["Ring", "find_rings", "overlap"]


@dataclass(frozen=True, eq=False)
class Ring:
    """One closed contour of one level.

    Attributes
    ----------
    level : int
        Position of the level in its run of levels, from 0.
    z : float
        Height in mm.
    points : (n, 2) float64
        mm in the plane, counter-clockwise whether outline or hole, first point not repeated.
    hole : bool
        Whether the ring bounds a hole.
    area : float
        mm^2 that the ring stands for: that of the pixels inside, or of the polygon.
    source_slice : int or None
        The source slice that it lies on; None between slices.
    depth : int
        How many rings of its level surround it: 0 outline, 1 hole, 2 island in a hole, ...
    mask : (a, b) uint8
        Pixels of the ring's bounding box with their centre inside.
    bbox_min : (2,) int64
        First pixel of that box.
    """

    level: int
    z: float
    points: FloatArray
    hole: bool
    area: float
    source_slice: int | None
    depth: int
    mask: ByteArray = field(repr=False)
    bbox_min: IntArray = field(repr=False)

    @property
    def bbox_max(self) -> IntArray:
        """First pixel (2,) beyond the bounding box."""
        return self.bbox_min + self.mask.shape


def find_rings(field: LevelField, level: int, spacing: FloatArray, of_pixels: bool) -> list[Ring]:
    """Every closed contour of a field at distance zero, largest first.

    Contours around no pixel's centre are left out.

    Parameters
    ----------
    field : LevelField
        Positive along its border.
    level : int
        The field's position in its run of levels.
    spacing : (2,) float64
        mm per pixel along i and j.
    of_pixels : bool
        Take a ring's area from the pixels it encloses instead of from its polygon.
    """
    lines = zero_contours(field.distance)
    found = [_ring(line[:-1], field, level, spacing, of_pixels) for line in lines]
    rings = sorted((ring for ring in found if ring is not None), key=lambda ring: -ring.area)
    return [
        replace(ring, depth=sum(_surrounds(larger, ring) for larger in rings[:n]))
        for n, ring in enumerate(rings)
    ]


def _ring(
    pixels: FloatArray, field: LevelField, level: int, spacing: FloatArray, of_pixels: bool
) -> Ring | None:
    """Ring of a contour (n, 2) in pixels, not nested yet; None when there is no pixel's centre inside."""
    keep = np.any(np.abs(pixels - np.roll(pixels, 1, axis=0)) > 1e-6, axis=1)
    pixels = np.ascontiguousarray(pixels[keep])
    if len(pixels) < 3:
        return None
    bbox_min = np.floor(pixels.min(axis=0)).astype(np.int64)
    extent = np.ceil(pixels.max(axis=0)).astype(np.int64) - bbox_min + 1
    mask = _pixels_inside(pixels - bbox_min, extent[0], extent[1])
    count = int(np.count_nonzero(mask))
    if count == 0:
        return None
    area = signed_area(pixels)
    points = (pixels if area > 0 else pixels[::-1]) * spacing
    stands_for = float((count if of_pixels else abs(area)) * spacing[0] * spacing[1])
    return Ring(level, field.z, points, area < 0, stands_for, field.source_slice, 0, mask, bbox_min)


@jit
def _pixels_inside(points: FloatArray, height: int, width: int) -> ByteArray:
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


def _surrounds(outer: Ring, inner: Ring) -> bool:
    """Whether one ring of a level lies inside another."""
    if np.any(inner.bbox_min < outer.bbox_min) or np.any(inner.bbox_max > outer.bbox_max):
        return False
    x, y = (float(value) for value in inner.points[0])
    return cv2.pointPolygonTest(outer.points.astype(np.float32)[:, None], (x, y), False) > 0


def overlap(first: Ring, second: Ring) -> int:
    """Count the pixels that lie inside both rings."""
    low = np.maximum(first.bbox_min, second.bbox_min)
    high = np.minimum(first.bbox_max, second.bbox_max)
    if np.any(high <= low):
        return 0
    inside_first, inside_second = (
        ring.mask[tuple(map(slice, low - ring.bbox_min, high - ring.bbox_min))] for ring in (first, second)
    )
    return int(np.count_nonzero(inside_first & inside_second))
