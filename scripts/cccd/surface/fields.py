"""Signed distance fields of slices: what the curves enclose, as a smooth function of the plane.

Distances are in mm, negative inside. A field lives on the pixels of the curves' bounding box, so the
contour at zero of a pixel mask's field encloses the *pixels*, half a pixel further out than the
polygon through their centres.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import map_coordinates

from cccd.geometry.arrays import FloatArray, IntArray, SingleArray
from cccd.geometry.distance import to_mask, to_polygons
from cccd.geometry.polygons import RaggedPolygons
from cccd.geometry.raster import rasterise_layers
from cccd.surface.outlines import Outlines, through_pixel_centres

__all__ = [
    "LevelField",
    "distance_fields",
    "distance_to_part",
    "interpolated_fields",
    "interpolated_planes",
    "sampled",
]

#: Fields reach this many pixels beyond the curves, so that every contour closes.
MARGIN_PIXELS = 4


@dataclass(frozen=True)
class LevelField:
    """Signed distances on one level.

    Attributes
    ----------
    z : float
        Height along the slice axis in mm (``k`` times the slice spacing).
    distance : (I, J) float32
        mm, negative inside.
    source_slice : int or None
        The source slice that it was taken from; None between slices.
    """

    z: float
    distance: SingleArray
    source_slice: int | None


def distance_fields(
    outlines: Outlines, reach: IntArray | None = None
) -> tuple[IntArray, SingleArray, IntArray]:
    """Signed distances of every slice that has outlines.

    Parameters
    ----------
    outlines : Outlines
        At least one. Distances are to their polygons moved outwards; to the border between pixels where
        these are chains of pixels.
    reach : (2, 2) int64, optional
        First and last source ``(i, j)`` that the fields shall reach beyond the outlines' own.

    Returns
    -------
    slices : (S,) int64
        Source slices, ascending.
    distance : (S, I, J) float32
        mm, negative inside.
    origin : (2,) int64
        Source ``(i, j)`` of ``distance[0, 0, 0]``.
    """
    curves = outlines.curves
    spacing = curves.frame.pixel_spacing
    slices, layer = np.unique(curves.slice, return_inverse=True)
    first, last = (np.floor(curves.points.min(axis=0)), np.ceil(curves.points.max(axis=0)))
    if reach is not None:
        first, last = np.minimum(first, reach[0]), np.maximum(last, reach[1])
    origin = first.astype(np.int64) - MARGIN_PIXELS
    shape = tuple(last.astype(np.int64) + MARGIN_PIXELS + 1 - origin)
    moved = RaggedPolygons(curves.points - origin, curves.offsets)
    mask = rasterise_layers(moved, layer, (len(slices), *shape))
    if outlines.of_pixels and through_pixel_centres(curves):
        distance = np.stack([to_mask(plane, spacing) for plane in mask])
        return slices.astype(np.int64), distance, origin
    polygons = RaggedPolygons((curves.points - origin) * spacing, curves.offsets)
    distance = np.empty(mask.shape, np.float32)
    for number, inside in enumerate(mask):
        here = layer == number
        distance[number] = to_polygons(inside, polygons.take(here), spacing, outlines.outwards[here])
    return slices.astype(np.int64), distance, origin


def interpolated_fields(
    slices: IntArray, distance: SingleArray, slice_spacing: float, level_spacing: float
) -> Iterator[LevelField]:
    """Fields of the slices and of levels between them: shape-based interpolation, monotone in z.

    Parameters
    ----------
    slices, distance
        As `distance_fields` returns them.
    slice_spacing : float
        mm between neighbouring source slices.
    level_spacing : float
        mm; levels lie at most this far apart.
    """
    height = np.asarray(slices * slice_spacing, float)
    slope = _slope(distance, height, 0)
    for s, z in enumerate(height):
        yield LevelField(float(z), distance[s], int(slices[s]))
        if s + 1 == len(height):
            return
        gap = height[s + 1] - z
        next_slope = _slope(distance, height, s + 1)
        parts = int(np.ceil(gap / level_spacing - 1e-6))
        for part in range(1, parts):
            t = np.float32(part / parts)
            plane = _cubic(t, gap, distance[s], distance[s + 1], slope, next_slope)
            yield LevelField(float(z + gap * t), plane, None)
        slope = next_slope


def interpolated_planes(height: FloatArray, distance: SingleArray, z: FloatArray) -> Iterator[SingleArray]:
    """Distances (I, J) at ascending heights ``z`` between those (S,) at which (S, I, J) are known, in mm."""
    known, slopes = -1, (distance[0], distance[0])
    below: IntArray = np.clip(np.searchsorted(height, z, side="right") - 1, 0, len(height) - 2)
    for s, level in zip(map(int, below), map(float, z), strict=True):
        if s != known:
            known, slopes = s, (_slope(distance, height, s), _slope(distance, height, s + 1))
        gap = height[s + 1] - height[s]
        yield _cubic(np.float32((level - height[s]) / gap), gap, distance[s], distance[s + 1], *slopes)


def _cubic(
    t: np.float32,
    gap: float,
    low: SingleArray,
    high: SingleArray,
    low_slope: SingleArray,
    high_slope: SingleArray,
) -> SingleArray:
    """Each pixel's distance at a share of the gap: a piecewise cubic Hermite polynomial along z."""
    # With Fritsch-Carlson slopes; Raya and Udupa 1990 interpolate linearly: the cubic has no kink at the
    # slices and does not overshoot.
    plane = (
        (1 + 2 * t) * (1 - t) ** 2 * low
        + t * t * (3 - 2 * t) * high
        + np.float32(gap) * (t * (1 - t) ** 2 * low_slope - t * t * (1 - t) * high_slope)
    )
    return np.asarray(plane, np.float32)


def _slope(distance: SingleArray, height: FloatArray, s: int) -> SingleArray:
    """Fritsch-Carlson slopes at slice ``s``: the weighted harmonic mean of the neighbouring secants."""
    if len(height) == 1:
        return np.zeros_like(distance[0])
    if s in (0, len(height) - 1):
        low = min(s, len(height) - 2)
        return (distance[low + 1] - distance[low]) / np.float32(height[low + 1] - height[low])
    before, after = np.float32(height[s] - height[s - 1]), np.float32(height[s + 1] - height[s])
    left = (distance[s] - distance[s - 1]) / before
    right = (distance[s + 1] - distance[s]) / after
    w1, w2 = 2 * after + before, after + 2 * before
    with np.errstate(divide="ignore", invalid="ignore"):
        mean = (w1 + w2) / (w1 / left + w2 / right)
    return np.where(left * right > 0, mean, np.float32(0))


def distance_to_part(distance: SingleArray, parts: IntArray, number: int, spacing: FloatArray) -> SingleArray:
    """Signed distances (I, J) in mm to one of a plane's connected parts.

    Parameters
    ----------
    distance : (I, J) float32
        To all parts, negative inside.
    parts : (I, J) int64
        Their numbers, 0 outside.
    number : int
    spacing : (2,) float64
        mm per pixel.
    """
    others = (parts > 0) & (parts != number)
    if not others.any():
        return distance
    own = to_mask(parts == number, spacing)
    return np.where(own <= to_mask(others, spacing), distance, own)


def sampled(plane: SingleArray, places: FloatArray) -> SingleArray:
    """Values (N,) of a plane (I, J) at places (N, 2) in pixels; beyond it, of its border."""
    return np.asarray(map_coordinates(plane, places.T, np.float32, order=1, mode="nearest"))
