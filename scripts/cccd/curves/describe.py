"""The curves stage: chain codes, corners and splines of ordered curves."""

from __future__ import annotations

import numpy as np

from cccd.chaincode import chain_codes, on_pixel_chain
from cccd.containers import Curves, FittedCurves
from cccd.curves.corners import k_cosine_corners
from cccd.curves.fitting import corner_splines, fit_splines
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
        closed cubic).
    """
    chained = bool(on_pixel_chain(curves.points, curves.offsets).all())
    codes = chain_codes(curves.points, curves.offsets) if chained else np.zeros(0, np.uint8)
    corner = k_cosine_corners(curves.points, curves.offsets, settings.k, settings.criterion)
    corner_offsets = offsets_of(sum_per_part(corner, curves.offsets).astype(np.int64))
    if settings.method == "corners":
        splines = corner_splines(curves, corner)
    else:
        splines = fit_splines(curves, settings)
    report = {
        "method": settings.method,
        "curves": len(curves),
        "points": len(curves.points),
        "corners": int(corner.sum()),
        "control_points": len(splines.control_points),
        "chain_coded": chained,
        "too_few_corners": int((np.diff(corner_offsets) < 4).sum()),
    }
    return FittedCurves(curves, codes, curves.points[corner], corner_offsets, splines, report)
