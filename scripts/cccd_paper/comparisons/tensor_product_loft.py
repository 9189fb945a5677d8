"""The paper's own surface, eq. (10): one tensor-product B-spline through every slice's largest outline."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from scipy.interpolate import BSpline

from cccd.containers import Curves, Splines
from cccd.curves.corners import k_cosine_corners
from cccd.curves.fitting import corner_splines
from cccd.geometry.arrays import FloatArray, IntArray
from cccd.geometry.flat_caps import fill_rim
from cccd.geometry.mesh import Mesh
from cccd.geometry.polygons import DEGREE

#: Samples of the surface for each slice; around there is one for each control point.
ALONG_SAMPLES = 4


@dataclass(frozen=True)
class TubeSettings:
    """What the paper leaves open about eq. (10).

    Attributes
    ----------
    k : int
        Of Definition 3.
    around : int
        Control points around each slice.
    outwards_px : float
        Pixels by which outlines through pixels' centres move outwards: the border of a mask lies half a
        pixel beyond them.
    beyond : float
        Share of the distance between slices by which the tube goes on beyond its first and last slice.
    """

    k: int
    around: int
    outwards_px: float
    beyond: float

    def __str__(self) -> str:
        return (
            f"k = {self.k}, {self.around} points around, {self.outwards_px:g} px outwards, "
            f"{self.beyond:g} slices beyond the ends"
        )


#: Chosen on a liver and a kidney that no table reports (docs/measured/tensor_product_loft.csv). k is the
#: paper's best; k = 1, every turn of the chain, comes .01 mm closer. 800 points are no closer than 400.
TUNED = TubeSettings(3, 400, 0.5, 0.25)


def tensor_product_loft(curves: Curves, settings: TubeSettings = TUNED) -> Mesh:
    """Loft one closed tube, eq. (10), from the corner splines of Definitions 3 and 4.

    Its control points are points of the splines, evenly along each; each slice's begin where the last
    slice's did. It knows neither branches, holes nor further parts; planes close its ends.

    Parameters
    ----------
    curves : Curves
        Ordered curves of at least two slices.
    settings : TubeSettings

    Returns
    -------
    Mesh
        Closed, in world mm (RAS), outwards.

    Raises
    ------
    ValueError
        With fewer than two slices.
    """
    corners = k_cosine_corners(curves.points, curves.offsets, settings.k)
    return loft_splines(curves, corner_splines(curves, corners), settings)


def loft_splines(curves: Curves, splines: Splines, settings: TubeSettings = TUNED) -> Mesh:
    """Loft one closed tube, eq. (10), from closed splines, one for each curve (Algorithm 1, line 22)."""
    chosen = _largest(curves)
    if len(chosen) < 2:
        raise ValueError("a surface of eq. (10) needs two slices")
    drawn = splines.sample().polygons.take(chosen)
    of_pixels = np.array_equal(curves.points, np.rint(curves.points))  # through their centres
    outwards = settings.outwards_px if of_pixels else 0.0
    outlines = [_grown(polygon, outwards) for polygon in np.split(drawn.points, drawn.offsets[1:-1])]
    net = np.stack(_aligned([_even(outline, settings.around) for outline in outlines]))
    heights = curves.slice[chosen].astype(float)
    if settings.beyond:
        net = np.concatenate([net[:1], net, net[-1:]])
        heights = np.concatenate([heights[:1] - settings.beyond, heights, heights[-1:] + settings.beyond])
    sheet = _along(_around(net), heights)
    points = curves.frame.to_world(sheet[..., :2].reshape(-1, 2), sheet[..., 2].ravel())
    return _closed(points.reshape(sheet.shape), sheet[[0, -1], :, :2])


def _largest(curves: Curves) -> IntArray:
    """Find the largest outline (S,) of each slice that has one."""
    area = np.where(curves.hole, 0.0, np.abs(curves.polygons.signed_areas))
    order = np.lexsort((-area, curves.slice))
    _, first = np.unique(curves.slice[order], return_index=True)
    return order[first][area[order[first]] > 0]


def _grown(polygon: FloatArray, pixels: float) -> FloatArray:
    """Outline of all that lies so near to a closed polygon or within it; the largest part."""
    if not pixels:
        return polygon
    grown = shapely.buffer(shapely.make_valid(shapely.Polygon(polygon)), pixels)
    parts = shapely.get_parts(grown)
    ring = shapely.get_exterior_ring(parts[shapely.area(parts).argmax()])
    return np.asarray(shapely.get_coordinates(ring))[:-1]


def _even(polygon: FloatArray, count: int) -> FloatArray:
    """Points (count, 2) evenly along a closed polygon, counter-clockwise."""
    closed = np.vstack([polygon, polygon[:1]])
    x, y = closed.T
    if np.sum(x[:-1] * y[1:] - x[1:] * y[:-1]) < 0:
        closed = closed[::-1]
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))])
    at = np.arange(count) * (length[-1] / count)
    return np.column_stack([np.interp(at, length, values) for values in closed.T])


def _aligned(sections: list[FloatArray]) -> list[FloatArray]:
    """Turn each section so that its points lie nearest to those of the section before."""
    turned = sections[:1]
    for section in sections[1:]:
        turns = np.stack([np.roll(section, -n, axis=0) for n in range(len(section))])
        turned.append(turns[np.sum((turns - turned[-1]) ** 2, axis=(1, 2)).argmin()])
    return turned


def _around(net: FloatArray) -> FloatArray:
    """Points (S, P, 2) of closed cubic splines with control points (S, P, 2)."""
    count = net.shape[1]
    control = np.concatenate([net, net[:, :DEGREE]], axis=1).transpose(1, 0, 2)
    knots = np.arange(-DEGREE, count + DEGREE + 1)
    return BSpline(knots, control, DEGREE)(np.arange(count)).transpose(1, 0, 2)


def _along(sections: FloatArray, slices: FloatArray) -> FloatArray:
    """Points (R, P, 3), in pixels and slices, of open splines with control points (S, P, 2) on ``slices``."""
    degree = min(DEGREE, len(slices) - 1)
    heights = np.broadcast_to(slices[:, None, None], (*sections.shape[:2], 1))
    control = np.concatenate([sections, heights], axis=2)
    inner = np.linspace(0, 1, len(slices) - degree + 1)
    knots = np.concatenate([np.zeros(degree), inner, np.ones(degree)])
    return np.asarray(BSpline(knots, control, degree)(np.linspace(0, 1, ALONG_SAMPLES * len(slices))))


def _closed(sheet: FloatArray, ends: FloatArray) -> Mesh:
    """Mesh a tube (R, P, 3) in mm, and close it where its first and last row are (2, P, 2) in the plane."""
    rows, around = sheet.shape[:2]
    number = np.arange(rows * around).reshape(rows, around)
    a, b = number[:-1], np.roll(number[:-1], -1, axis=1)
    c, d = np.roll(number[1:], -1, axis=1), number[1:]
    faces = [np.stack([a, b, c], axis=-1).reshape(-1, 3), np.stack([a, c, d], axis=-1).reshape(-1, 3)]
    rim = np.column_stack([np.arange(around), np.roll(np.arange(around), -1)])
    for row, plane, upwards in ((0, ends[0], False), (-1, ends[1], True)):
        own = number[row][fill_rim(plane, rim)]
        faces.append(own if upwards else own[:, ::-1])
    return Mesh(sheet.reshape(-1, 3), np.concatenate(faces)).outwards()
