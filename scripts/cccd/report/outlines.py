"""CCCD's outline on a slice for several k: Figures 10, 12 and 14 with our own contours."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes

from cccd.containers import Curves
from cccd.curves import corner_splines, sample_splines
from cccd.curves.corners import k_cosine_corners
from cccd.metrics import dice, rasterise_slice
from cccd.report.svg import INK, SERIES, axes, style, to_svg

__all__ = ["Outline", "draw_outlines", "middle_curve"]


class Outline(NamedTuple):
    """A contour and the k with which its corners are sought; ``title`` stands above the panel."""

    title: str
    curve: Curves
    k: int


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


def draw_outlines(key: str, outlines: Sequence[Outline], label: str) -> str:
    """Draw boundary (band), corners (dots) and spline (line), one panel each, as SVG.

    The splines are the paper's: corners at maxima of curvature are the control points (eq. 9).
    """
    with style():
        figure, grid = axes(2.3 * len(outlines), 2.9, columns=len(outlines))
        for axis, outline in zip(np.atleast_1d(grid), outlines, strict=True):
            _draw(axis, outline)
        return to_svg(figure, key, label)


def _draw(axis: Axes, outline: Outline) -> None:
    curve = outline.curve
    corner = k_cosine_corners(curve.points, curve.offsets, outline.k)
    splines = corner_splines(curve, corner)
    drawn = sample_splines(splines).points
    low = np.floor(np.minimum(curve.points.min(axis=0), drawn.min(axis=0))).astype(int) - 2
    shape = np.ceil(np.maximum(curve.points.max(axis=0), drawn.max(axis=0))).astype(int) + 3 - low
    score = dice(rasterise_slice([curve.points], low, shape), rasterise_slice([drawn], low, shape))
    for points, look in (
        (curve.points, {"color": SERIES[5], "linewidth": 3.2, "alpha": 0.55}),
        (drawn, {"color": INK, "linewidth": 1.0}),
    ):
        closed = np.vstack([points, points[:1]])
        axis.plot(closed[:, 1], closed[:, 0], **look)
    control = splines.control_points
    axis.plot(control[:, 1], control[:, 0], ".", color=SERIES[1], markersize=3.5)
    axis.set_title(f"{outline.title}\n{len(control)} points, Dice {100 * score:.2f} %", fontsize=8)
    axis.set(aspect="equal", xticks=[], yticks=[])
    axis.invert_yaxis()
    axis.grid(False)
    for spine in axis.spines.values():
        spine.set_visible(False)
