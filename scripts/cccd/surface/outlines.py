"""What a surface is lofted from: the curves' closed splines, or the polygons."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cccd.containers import Curves, Sections
from cccd.curves.fitting import fit_splines, sample_splines
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
    areas : (C,) float64
        Pixels that each outline encloses when it has moved; of a hole, less than zero.
    of_pixels : bool
        Whether the outlines stand for the area of whole pixels.
    """

    curves: Curves
    outwards: FloatArray
    areas: FloatArray
    of_pixels: bool


def lofted_outlines(sections: Sections, settings: LoftSettings) -> Outlines:
    """Outlines to loft from.

    Parameters
    ----------
    sections : Sections
        Their splines are fitted here, by the default settings, where they are needed and not given.
    settings : LoftSettings
        ``source``: ``splines``, or ``polygons`` (the curves themselves).
    """
    curves, splines = sections.curves, sections.splines
    of_pixels = through_pixel_centres(curves)
    if settings.source == "polygons":
        if of_pixels:
            return Outlines(curves, np.full(len(curves), 0.5), _pixels(curves), True)
        return Outlines(curves, np.zeros(len(curves)), _areas(curves), False)
    drawn = sample_splines(fit_splines(curves) if splines is None else splines)
    if of_pixels:
        return Outlines(drawn, *_grown(drawn, _pixels(curves)), True)
    return Outlines(drawn, np.zeros(len(curves)), _areas(drawn), False)


def through_pixel_centres(curves: Curves) -> bool:
    """Report whether these are pixel chains (every point an integer), not drawn contours."""
    return bool(np.array_equal(curves.points, np.rint(curves.points)))


def _areas(curves: Curves) -> FloatArray:
    """Pixels (C,) that polygons enclose; less than zero in holes."""
    return np.abs(curves.polygons.signed_areas) * np.where(curves.hole, -1.0, 1.0)


def _pixels(chains: Curves) -> FloatArray:
    """Count the pixels (C,) that chains of pixels bound; less than zero in holes, which lie within theirs."""
    # By Pick's theorem (1899) that is the chain's own area and half a pixel per link, plus one; for a hole
    # half a pixel per link is taken off.
    hole = np.where(chains.hole, -1.0, 1.0)
    return hole * (np.abs(chains.polygons.signed_areas) + hole * np.diff(chains.offsets) / 2 + 1)


def _grown(drawn: Curves, pixels: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Pixels (C,) by which drawn splines move outwards to enclose so many (C,), and what they enclose."""
    # An outline that moves by d, in the norm in which a pixel's border lies half a pixel from its centre,
    # gains d times its extent, the sum of the larger part of every step, and 2 d^2 for turning round once.
    hole, areas = np.where(drawn.hole, -1.0, 1.0), _areas(drawn)
    extent = sum_per_part(np.abs(drawn.polygons.steps).max(axis=1), drawn.offsets)
    root = np.sqrt(np.maximum(extent**2 + hole * 8 * (pixels - areas), 0))
    moved = np.clip(hole * (root - extent) / 4, 0, MOST_OUTWARDS)
    return moved, areas + moved * extent + hole * 2 * moved**2
