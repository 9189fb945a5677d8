"""What a surface is lofted from: the curves' closed splines, the paper's corner splines, or the polygons."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cccd.containers import Curves, Splines
from cccd.curves.corners import k_cosine_corners
from cccd.curves.fitting import corner_splines, fit_splines, sample_splines
from cccd.geometry.arrays import FloatArray, sum_per_part
from cccd.settings.surface import LoftSettings

__all__ = ["Outlines", "lofted_outlines", "through_pixel_centres"]

#: An outline lies at most this many pixels inside the organ's border: no offset makes up for a poor spline.
MOST_OUTWARDS = 1.0


@dataclass(frozen=True, eq=False)
class Outlines:
    """Closed polygons, and how far beyond them the organ's border lies.

    Attributes
    ----------
    curves : Curves
        Curves of pixels, or splines drawn with some points per pixel.
    outwards : (C,) float64
        Pixels that each outline moves outwards where it runs along a row of pixels, down to 1/sqrt(2) of
        that on a diagonal; zero where the outline is the border itself.
    of_pixels : bool
        Whether the outlines stand for the area of pixels.
    """

    curves: Curves
    outwards: FloatArray
    of_pixels: bool


def lofted_outlines(curves: Curves, splines: Splines | None, settings: LoftSettings) -> Outlines:
    """Outlines to loft from.

    Parameters
    ----------
    curves : Curves
        Ordered curves: through the centres of an organ's outermost pixels, or drawn along its border.
    splines : Splines or None
        Their closed splines; fitted here, by the default settings, where they are needed and not given.
    settings : LoftSettings
        ``source``: ``splines``, ``polygons`` (the curves themselves), or ``corners``, the paper's splines
        through the sharpest points of support ``corner_k`` (Definitions 3 and 4).
    """
    of_pixels = through_pixel_centres(curves)
    if settings.source == "polygons":
        return Outlines(curves, np.full(len(curves), 0.5 if of_pixels else 0.0), of_pixels)
    if settings.source == "corners":
        splines = corner_splines(curves, k_cosine_corners(curves.points, curves.offsets, settings.corner_k))
    elif splines is None:
        splines = fit_splines(curves)
    drawn = sample_splines(splines)
    return Outlines(drawn, _outwards(curves, drawn) if of_pixels else np.zeros(len(curves)), of_pixels)


def through_pixel_centres(curves: Curves) -> bool:
    """Report whether these are pixel chains (every point an integer), not drawn contours."""
    return bool(np.array_equal(curves.points, np.rint(curves.points)))


def _outwards(chains: Curves, drawn: Curves) -> FloatArray:
    """Pixels (C,) by which drawn splines move outwards to enclose the area of their chains' pixels.

    By Pick's theorem that is the chain's own area and half a pixel per link, plus one (less, in a hole).
    An outline that moves by d, in the norm in which a pixel's border lies half a pixel from its centre, gains
    d times its extent, the sum of the larger part of every step, and 2 d^2 for turning round once. A straight
    one moves by one half; one that was smoothed off a small organ, by somewhat more.
    """
    hole = np.where(chains.hole, -1.0, 1.0)
    pixels = np.abs(chains.polygons.signed_areas) + hole * np.diff(chains.offsets) / 2 + 1
    missing = hole * (pixels - np.abs(drawn.polygons.signed_areas))
    extent = sum_per_part(np.abs(drawn.polygons.steps).max(axis=1), drawn.offsets)
    root = np.sqrt(np.maximum(extent**2 + hole * 8 * missing, 0))
    return np.clip(hole * (root - extent) / 4, 0, MOST_OUTWARDS)
