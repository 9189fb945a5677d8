"""The curves stage: chain codes, corners and splines of ordered curves."""

from __future__ import annotations

import numpy as np
from shapely import LinearRing, Polygon
from shapely.validation import explain_validity

from cccd.chaincode import chain_codes, on_pixel_chain
from cccd.containers import Curves, FittedCurves, Frame, Splines
from cccd.curves.corners import k_cosine_corners
from cccd.curves.fitting import corner_splines, crossed_curves, crossing_place, fit_checked
from cccd.geometry.arrays import offsets_of, sum_per_part
from cccd.settings.curves import CurveSettings

#: So many places are named in a message.
_MOST_PLACES = 5


def describe_curves(curves: Curves, settings: CurveSettings) -> FittedCurves:
    """Chain codes, corners and splines of every curve.

    Returns
    -------
    FittedCurves
        Its report has ``method``, and as plain numbers ``curves``, ``points``, ``corners``,
        ``control_points``, ``chain_coded``, ``too_few_corners`` (curves whose corners alone do not make a
        closed cubic), ``mended`` (splines that crossed or strayed, and were made anew); ``warnings``, lines
        about splines that cross because their curves do, themselves or each other.
    """
    chained = bool(on_pixel_chain(curves.points, curves.offsets).all())
    codes = chain_codes(curves.points, curves.offsets) if chained else np.zeros(0, np.uint8)
    corner = k_cosine_corners(curves.points, curves.offsets, settings.k, settings.criterion)
    corner_offsets = offsets_of(sum_per_part(corner, curves.offsets).astype(np.int64))
    checked = fit_checked(
        curves, settings, corner_splines(curves, corner) if settings.method == "corners" else None
    )
    splines = checked.splines
    report = {
        "method": settings.method,
        "curves": len(curves),
        "points": len(curves.points),
        "corners": int(corner.sum()),
        "control_points": len(splines.control_points),
        "chain_coded": chained,
        "too_few_corners": int((np.diff(corner_offsets) < 4).sum()),
        "mended": int(checked.mended.sum()),
        "warnings": [*_crossings(splines, checked.wrong), *crossed_warnings(curves)],
    }
    return FittedCurves(curves, codes, curves.points[corner], corner_offsets, splines, report)


def _crossings(splines: Splines, wrong: np.ndarray) -> list[str]:
    """Say in one line which splines (C,) bool cross, and where."""
    chosen = np.flatnonzero(wrong)
    at = [
        crossing_place(
            splines.control_points[slice(*splines.offsets[number : number + 2])],
            splines.knots[slice(*splines.knot_offsets[number : number + 2])],
        )
        for number in chosen[:_MOST_PLACES]
    ]
    one, many = "1 curve crosses itself or another", "curves cross themselves or others"
    return _said(splines.frame, splines.slice[chosen], np.array(at), one, many, ", and so do the splines")


def crossed_warnings(curves: Curves) -> list[str]:
    """Say in one line which given curves cross each other, and where."""
    one, many = "2 curves cross each other", "pairs of curves cross each other"
    return _said(curves.frame, *crossed_curves(curves), one, many, ", and so do the splines")


def self_crossed_warnings(curves: Curves) -> list[str]:
    """Say in one line which given curves cross themselves, and where."""
    rings = [LinearRing(ring) for ring in curves.polygons]
    wrong = [number for number, ring in enumerate(rings) if not ring.is_simple]
    found = [explain_validity(Polygon(rings[number])) for number in wrong[:_MOST_PLACES]]
    at = np.array([[float(word) for word in line[line.index("[") + 1 : -1].split()] for line in found])
    return _said(curves.frame, curves.slice[wrong], at, "1 curve crosses itself", "curves cross themselves")


def _said(
    frame: Frame, slices: np.ndarray, points: np.ndarray, one: str, many: str, also: str = ""
) -> list[str]:
    """Write a line on what is wrong on slices (N,), with the places (N, 2) of the first."""
    count = len(slices)
    if not count:
        return []
    places = _places(frame, slices[:_MOST_PLACES], points[:_MOST_PLACES])
    what = one if count == 1 else f"{count} {many}"
    return [f"{what}{also}: {places}{' and so on' if count > _MOST_PLACES else ''}"]


def _places(frame: Frame, slices: np.ndarray, points: np.ndarray) -> str:
    """Name points (N, 2) of slices (N,), in pixels and in mm (RAS)."""
    places: list[str] = []
    for number, (i, j) in zip(slices, points, strict=True):
        x, y, z = frame.to_world(np.array([[i, j]]), number)[0]
        places.append(f"slice {number} at ({i:.1f}, {j:.1f}), {x:.1f}, {y:.1f}, {z:.1f} mm")
    return "; ".join(places)
