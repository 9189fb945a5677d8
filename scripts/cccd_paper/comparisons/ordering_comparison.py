"""How well the junction network would have ordered what was traced exactly: a mask's boundary pixels."""

from __future__ import annotations

import numpy as np
import pandas as pd

from cccd.containers import Boundaries, Curves, Structure
from cccd.geometry.arrays import IntArray
from cccd.geometry.raster import dice
from cccd_junctions.decoding import find_outline
from cccd_junctions.delaunay import build_graph
from cccd_junctions.inference import Predictor
from cccd_junctions.ordering import order_boundaries


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
        From `cccd_junctions.checkpoint.load_model`.

    Returns
    -------
    DataFrame
        One row: the totals of `cccd_junctions.ordering.order_boundaries` (``unclosed``: a number of slices);
        ``slices``, and how many of them the network ``decided``, because they are no outlines already;
        ``curves`` by the network, ``curves_exact`` by tracing, and the two's Dice in three dimensions, of all
        slices (``dice``) and of the decided ones (``dice_decided``, missing where there is none).
    """
    ordered, report = order_boundaries(
        boundaries, model, image=structure.stack("image"), image_origin=structure.stack_origin
    )
    totals = {name: value for name, value in report.items() if isinstance(value, int)}
    decided = decided_slices(boundaries)
    row = {
        **totals,
        "unclosed": len(report["unclosed"]),
        "slices": len(boundaries.slice),
        "decided": len(decided),
        "curves": len(ordered),
        "curves_exact": len(contours),
        "dice": _dice_3d(contours, ordered, boundaries.slice),
        "dice_decided": _dice_3d(contours, ordered, decided) if len(decided) else np.nan,
    }
    return pd.DataFrame([row])


def decided_slices(boundaries: Boundaries) -> IntArray:
    """Numbers of the slices whose boundary map is no outline already: only there a network is asked."""
    doubtful = [
        k
        for k, pixels in zip(boundaries.slice, boundaries, strict=True)
        if len(pixels) and not find_outline(build_graph(pixels)).exact
    ]
    return np.array(doubtful, np.int64)


def _dice_3d(exact: Curves, other: Curves, slices: IntArray) -> float:
    """3D Dice of what two sets of curves of one structure enclose on some slices."""
    if not len(exact) or not len(other):
        return 0.0
    low = np.floor(exact.points.min(0)).astype(int) - 1
    shape = np.ceil(exact.points.max(0)).astype(int) + 2 - low
    first = int(min(exact.slice.min(), other.slice.min(), slices.min()))
    last = int(max(exact.slice.max(), other.slice.max(), slices.max()))
    blocks = [curves.rasterise((first, *low), (last - first + 1, *shape)) for curves in (exact, other)]
    traced, found = (block[slices - first] for block in blocks)
    return float(dice(traced, found))
