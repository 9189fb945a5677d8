"""How well the junction network would have ordered what was traced exactly: a mask's boundary pixels."""

from __future__ import annotations

import numpy as np
import pandas as pd

from cccd.containers import Boundaries, Curves, Structure
from cccd.junctions import Predictor, order_boundaries
from cccd.metrics import dice

__all__ = ["compare_ordering"]


def compare_ordering(
    structure: Structure, boundaries: Boundaries, contours: Curves, model: Predictor
) -> pd.DataFrame:
    """Order a mask's boundary pixels by the network and hold the result against the traced contours.

    Parameters
    ----------
    structure : Structure
    boundaries : Boundaries
        Its boundary pixels.
    contours : Curves
        The traced contours, taken as the truth.
    model : Predictor
        From `cccd.junctions.checkpoint.load_model`.

    Returns
    -------
    DataFrame
        One row: the totals of `cccd.junctions.order_boundaries` (``unclosed`` as a number of slices),
        ``curves`` by the network, ``curves_exact`` by tracing, and ``dice`` of the two in three dimensions.
    """
    ordered, report = order_boundaries(
        boundaries, model, image=structure.stack("image"), image_origin=structure.stack_origin
    )
    totals = {name: value for name, value in report.items() if isinstance(value, int)}
    row = {
        **totals,
        "unclosed": len(report["unclosed"]),
        "curves": len(ordered),
        "curves_exact": len(contours),
        "dice": _dice_3d(contours, ordered),
    }
    return pd.DataFrame([row])


def _dice_3d(exact: Curves, other: Curves) -> float:
    """3D Dice of what two sets of curves of one structure enclose."""
    if not len(exact) or not len(other):
        return 0.0
    low = np.floor(exact.points.min(0)).astype(int) - 1
    shape = np.ceil(exact.points.max(0)).astype(int) + 2 - low
    slices = np.union1d(exact.slice, other.slice)
    origin = (slices[0], *low)
    extent = (slices[-1] - slices[0] + 1, *shape)
    return float(dice(exact.rasterise(origin, extent), other.rasterise(origin, extent)))
