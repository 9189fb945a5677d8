"""The sweep over k on one structure: Figures 10, 12, 13 and 14."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from cccd.comparisons.paper_k import OUTLINES
from cccd.containers import Curves, Panel, SliceFigure, Structure
from cccd.curves import corner_splines, sample_splines, sweep_k
from cccd.curves.corners import k_cosine_corners
from cccd.geometry.raster import rasterise
from cccd.metrics import dice

__all__ = ["compare_k", "middle_curve", "outline_figures"]


def compare_k(structure: Structure, curves: Curves, ks: Sequence[int]) -> pd.DataFrame:
    """Measure the paper's own splines for each k and criterion (see `cccd.curves.sweep_k`).

    Parameters
    ----------
    structure : Structure
        Its mask is the truth; without one the filled curves are.
    curves : Curves
    ks : sequence of int
    """
    return sweep_k(curves, structure.stack("mask"), structure.stack_origin, ks=ks)


def outline_figures(structure: Structure, curves: Curves, ks: Sequence[int]) -> dict[str, SliceFigure]:
    """Outline the middle slice for the k of Figures 10, 12 and 14; nothing where there is no outer curve."""
    curve = middle_curve(curves)
    if curve is None:
        return {}
    return {figure: SliceFigure([_outline(curve, k) for k in ks]) for figure, ks in OUTLINES.items()}


def middle_curve(curves: Curves) -> Curves | None:
    """Take the longest outer curve of the middle slice; None when there is none."""
    outer = np.flatnonzero(~curves.hole)
    if len(outer) == 0:
        return None
    slices = np.unique(curves.slice[outer])
    here = outer[curves.slice[outer] == slices[len(slices) // 2]]
    sizes = np.diff(curves.offsets)[here]
    chosen = here[np.argmax(sizes)]
    part = slice(curves.offsets[chosen], curves.offsets[chosen + 1])
    offsets = np.array([0, sizes.max()], np.int64)
    return Curves(curves.points[part], offsets, curves.slice[[chosen]], curves.hole[[chosen]], curves.frame)


def _outline(curve: Curves, k: int) -> Panel:
    """Boundary, corners and the paper's spline: corners at maxima of curvature as control points (eq. 9)."""
    splines = corner_splines(curve, k_cosine_corners(curve.points, curve.offsets, k))
    drawn = sample_splines(splines).points
    low = np.floor(np.minimum(curve.points.min(axis=0), drawn.min(axis=0))).astype(int) - 2
    shape = np.ceil(np.maximum(curve.points.max(axis=0), drawn.max(axis=0))).astype(int) + 3 - low
    score = dice(rasterise([curve.points], low, shape), rasterise([drawn], low, shape))
    control = splines.control_points
    return Panel(
        f"k = {k}",
        {"boundary": curve.points, "spline": drawn, "corners": control},
        detail=f"{len(control)} points, Dice {100 * score:.2f} %",
    )
