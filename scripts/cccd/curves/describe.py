"""The curves stage: chain codes, corners and splines of ordered curves."""

from __future__ import annotations

import numpy as np

from cccd.chaincode import chain_codes, on_pixel_chain
from cccd.containers import Curves, FittedCurves, Splines
from cccd.curves.corners import k_cosine_corners
from cccd.curves.fitting import corner_splines, crossing_place, fit_checked
from cccd.geometry.arrays import offsets_of, sum_per_part
from cccd.settings.curves import CurveSettings

__all__ = ["describe_curves"]


def describe_curves(curves: Curves, settings: CurveSettings) -> FittedCurves:
    """Chain codes, corners and splines of every curve.

    Parameters
    ----------
    curves : Curves
    settings : CurveSettings

    Returns
    -------
    FittedCurves
        Its report has ``method``, and as plain numbers ``curves``, ``points``, ``corners``,
        ``control_points``, ``chain_coded``, ``too_few_corners`` (curves whose corners alone do not make a
        closed cubic), ``mended`` (splines that crossed or strayed, and were made anew); ``warnings``, lines
        about splines that still cross, because their curves do.
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
        "warnings": _crossings(splines, checked.wrong),
    }
    return FittedCurves(curves, codes, curves.points[corner], corner_offsets, splines, report)


def _crossings(splines: Splines, wrong: np.ndarray, most: int = 5) -> list[str]:
    """Say in one line which splines (C,) bool cross, and where, in pixels and in mm (RAS)."""
    places: list[str] = []
    for number in np.flatnonzero(wrong)[:most]:
        begin, end = splines.offsets[number : number + 2]
        first, last = splines.knot_offsets[number : number + 2]
        at = crossing_place(splines.control_points[begin:end], splines.knots[first:last])
        i, j = at
        x, y, z = splines.frame.to_world(at[None], splines.slice[number])[0]
        places.append(f"slice {splines.slice[number]} at ({i:.1f}, {j:.1f}), {x:.1f}, {y:.1f}, {z:.1f} mm")
    if not places:
        return []
    count = int(wrong.sum())
    what = "1 curve crosses itself or another" if count == 1 else f"{count} curves cross themselves or others"
    return [f"{what}, and so do the splines: {'; '.join(places)}{' and so on' if count > most else ''}"]
