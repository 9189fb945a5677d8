"""What closed splines are worth (agreement, points and bytes), and which slices are doubtful."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import cv2
import numpy as np
import shapely

from cccd.containers import Curves, Splines
from cccd.geometry.arrays import owners_of
from cccd.geometry.raster import dice, rasterise

#: A pixel is a bit of the file.
_ONE_BIT = [cv2.IMWRITE_PNG_BILEVEL, 1]


def area_scores(curves: Curves, others: Curves) -> tuple[np.ndarray, np.ndarray]:
    """Dice scores (S,), and shares (S,) of area kept, of two sets of curves on each slice of the first.

    Areas are those of the polygons (even-odd), not of pixels: a curve through the pixel centres runs half a
    pixel inside the organ's own border, where counting centres would be a matter of rounding.
    """
    slices = np.unique(curves.slice)
    truth, claim = _regions(curves, slices), _regions(others, slices)
    own, other = shapely.area(truth), shapely.area(claim)
    common = shapely.area(shapely.intersection(truth, claim))
    return 2 * common / (own + other), other / own


def _regions(curves: Curves, slices: np.ndarray) -> np.ndarray:
    """Region (S,) enclosed on each of the slices by the even-odd rule."""
    polygons = np.asarray(shapely.polygons(curves.polygons.rings()))
    invalid = ~shapely.is_valid(polygons)  # the paper's splines may cross themselves
    polygons[invalid] = shapely.make_valid(polygons[invalid])
    begin, end = np.searchsorted(curves.slice, slices), np.searchsorted(curves.slice, slices, side="right")
    return np.array(
        [shapely.symmetric_difference_all(polygons[a:b]) for a, b in zip(begin, end, strict=True)]
    )


def distances(points: np.ndarray, offsets: np.ndarray, curves: Curves) -> np.ndarray:
    """Distance (P,) in pixels from ragged points to the closed polygon of the same number."""
    rings = curves.polygons.rings()
    shapely.prepare(rings)
    return shapely.distance(shapely.points(points), rings[owners_of(offsets)])


def bytes_per_slice(curves: Curves, splines: Splines) -> dict[str, np.ndarray]:
    """Bytes (S,) that each slice takes in several forms.

    Returns
    -------
    dict
        ``spline``: control points as float32 pairs, one float32 knot per control point and the period
        (the other knots repeat them), 4 bytes of header (count, hole) per curve, 4 per slice;
        ``spline_16_bit``: the same in 16-bit fixed point;
        ``chain_code``: 3 bits per link, 4 bytes of start and 4 of header per curve, 4 per slice;
        ``raw``: a contour of 16-bit pixel indices, headers alike;
        ``png``: the filled slice of the source volume as a 1-bit PNG file.
    """
    slices, owner = np.unique(curves.slice, return_inverse=True)

    def per_slice(per_curve: np.ndarray) -> np.ndarray:
        return 4 + np.bincount(owner, per_curve, len(slices)).astype(np.int64)

    controls, links = np.diff(splines.offsets), np.diff(curves.offsets)
    return {
        "spline": per_slice(4 + 4 * (3 * controls + 1)),
        "spline_16_bit": per_slice(4 + 2 * (3 * controls + 1)),
        "chain_code": per_slice(8 + np.ceil(3 * links / 8)),
        "raw": per_slice(4 + 4 * links),
        "png": np.array(_png_bytes(curves, slices), np.int64),
    }


def _png_bytes(curves: Curves, slices: np.ndarray) -> list[int]:
    rows, columns = (curves.frame.shape[axis] for axis in curves.frame.in_plane_axes)
    filled = (rasterise(curves.polygons.take(curves.slice == k), (0, 0), (rows, columns)) for k in slices)
    return [len(cv2.imencode(".png", 255 * image.astype(np.uint8), _ONE_BIT)[1]) for image in filled]


def measure_curves(curves: Curves, splines: Splines) -> dict:
    """Measure splines against the curves they describe.

    Returns
    -------
    dict
        Plain numbers for ``metrics.json``. Dice scores and areas compare the spline's area with the
        pixel-centre polygon's; ``raster_dice`` counts pixel centres. Distances are from the boundary
        pixels to the curve. Medians and percentiles run over slices.
    """
    if len(curves) == 0:
        return {"slices": 0, "curves": 0, "boundary_points": 0, "control_points": 0}
    drawn = splines.sample()
    scores, kept = area_scores(curves, drawn)
    origin, shape = window_of(curves)
    raster = dice(curves.rasterise(origin, shape), drawn.rasterise(origin, shape), (1, 2))
    raster_dice = np.asarray(raster)[np.unique(curves.slice) - origin[0]]
    away = distances(curves.points, curves.offsets, drawn)
    total = drawn.polygons.signed_areas.sum() / curves.polygons.signed_areas.sum()
    sizes = bytes_per_slice(curves, splines)
    return {
        "slices": len(scores),
        "curves": len(curves),
        "boundary_points": len(curves.points),
        "control_points": len(splines.control_points),
        "control_point_share": len(splines.control_points) / len(curves.points),
        "dice_median": float(np.median(scores)),
        "dice_p5": float(np.percentile(scores, 5)),
        "raster_dice_median": float(np.median(raster_dice)),
        "raster_dice_p5": float(np.percentile(raster_dice, 5)),
        "area_kept": float(total),
        "area_kept_min": float(kept.min()),
        "area_kept_max": float(kept.max()),
        "distance_mean_px": float(away.mean()),
        "distance_max_px": float(away.max()),
        "bytes_per_slice": {name: float(np.median(size)) for name, size in sizes.items()},
    }


def window_of(curves: Curves) -> tuple[np.ndarray, tuple[int, int, int]]:
    """Origin (k, i, j) and shape of the smallest stack that holds the curves, with a margin."""
    low = np.floor(curves.points.min(axis=0)).astype(int) - 2
    high = np.ceil(curves.points.max(axis=0)).astype(int) + 3
    first, last = int(curves.slice.min()), int(curves.slice.max())
    rows, columns = (int(n) for n in high - low)
    return np.array([first, *low]), (last - first + 1, rows, columns)


def doubtful_slices(report: Mapping[str, Any], most: int = 10) -> list[str]:
    """Say, of what `cccd_junctions.ordering.order_boundaries` reports, which slices should be looked at.

    Examples
    --------
    >>> found = {"slices": 4 * [{}], "doubtful": [7, 3], "expected_wrong": 1.24, "unlisted_wrong": 0.1}
    >>> print(*doubtful_slices(found))
    check these slices, the most doubtful first: 7, 3 (2 of 4; about 1.2 are expected to be wrong; of the \
others at most 10 % on average)
    >>> print(*doubtful_slices(found | {"doubtful": [3, 1, 0]}))
    most slices are doubtful (3 of 4; about 1.2 are expected to be wrong): check each of them
    """
    doubtful = report.get("doubtful", [])
    if not doubtful:
        return []
    whole = len(report["slices"])
    wrong = f"about {report['expected_wrong']:.2g} are expected to be wrong"
    if len(doubtful) > whole / 2:  # such a list helps nobody to choose
        return [f"most slices are doubtful ({len(doubtful)} of {whole}; {wrong}): check each of them"]
    listed = ", ".join(map(str, doubtful[:most])) + (" and so on" if len(doubtful) > most else "")
    if report["unlisted_wrong"] is not None:
        wrong += f"; of the others at most {100 * report['unlisted_wrong']:.3g} % on average"
    return [f"check these slices, the most doubtful first: {listed} ({len(doubtful)} of {whole}; {wrong})"]
