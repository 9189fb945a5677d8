"""Signed distance fields of slices: what the curves enclose, as a smooth function of the plane.

Distances are in mm, negative inside. A field lives on the pixels of the curves' bounding box, so the
contour at zero of a pixel mask's field encloses the *pixels*, half a pixel further out than the
polygon through their centres.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from cccd.geometry.arrays import FloatArray, IntArray, SingleArray
from cccd.geometry.distance import to_mask, to_polygons
from cccd.geometry.polygons import RaggedPolygons
from cccd.geometry.raster import rasterise_layers
from cccd.surface.outlines import Outlines, through_pixel_centres

__all__ = ["LevelField", "distance_fields", "interpolated_fields"]

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


def distance_fields(outlines: Outlines) -> tuple[IntArray, SingleArray, IntArray]:
    """Signed distances of every slice that has outlines.

    Parameters
    ----------
    outlines : Outlines
        At least one. Distances are to their polygons moved outwards; to the border between pixels where
        these are chains of pixels.

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
    origin = np.floor(curves.points.min(axis=0)).astype(np.int64) - MARGIN_PIXELS
    shape = tuple(np.ceil(curves.points.max(axis=0)).astype(np.int64) + MARGIN_PIXELS + 1 - origin)
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

    Each pixel's distance runs along z as a piecewise cubic Hermite polynomial with Fritsch-Carlson
    slopes (Raya and Udupa 1990 interpolate linearly; the cubic has no kink at the slices and does not
    overshoot).

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
            yield LevelField(
                float(z + gap * t),
                (1 + 2 * t) * (1 - t) ** 2 * distance[s]
                + t * t * (3 - 2 * t) * distance[s + 1]
                + np.float32(gap) * (t * (1 - t) ** 2 * slope - t * t * (1 - t) * next_slope),
                None,
            )
        slope = next_slope


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
