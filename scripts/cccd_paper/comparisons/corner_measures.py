"""What splines are worth whose control points are corners of their curves (Definition 4)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cccd.containers import Curves, Splines
from cccd.curves.corners import k_cosine_corners
from cccd.curves.fitting import corner_splines
from cccd.curves.knots import FEWEST
from cccd.geometry.arrays import sum_per_part
from cccd.settings.curves import CurveSettings
from cccd_paper.comparisons.confusion import confusion
from cccd_workflow.curve_measures import window_of

#: The k of the paper's figures 10-13.
SWEEP = CurveSettings().sweep


def paper_splines(curves: Curves, k: int) -> Splines:
    """Splines through the corners of one k, maxima of curvature, as control points (eq. 9)."""
    return corner_splines(curves, k_cosine_corners(curves.points, curves.offsets, k))


def measure_corners(
    curves: Curves,
    corner: np.ndarray,
    truth: np.ndarray | None = None,
    origin: Sequence[int] | np.ndarray = (0, 0, 0),
) -> dict[str, float]:
    """Measure the splines whose control points are some of the curves' points (Definition 4).

    Parameters
    ----------
    curves : Curves
    corner : (P,) bool array
        Which points are control points.
    truth : (S, I, J) bool array, optional
        Ground truth; the filled curves themselves by default.
    origin : (3,) int, optional
        Source index (k, i, j) of the truth's first pixel.

    Returns
    -------
    dict
        ``corners`` and their ``share`` of the boundary pixels; ``too_few``, the share of curves with fewer
        corners than a closed cubic needs, which get evenly spaced points instead; ``corners_per_slice`` and
        ``bytes_per_slice`` (two 32-bit numbers per corner, as the paper counts), both medians; equations
        12-21 under their printed names as medians over slices and, with ``(whole)``, over all pixels of the
        slices with organ; the standard definitions likewise. Rates are shares of the source volume's
        whole slices.
    """
    if truth is None:
        origin, shape = window_of(curves)
        truth = curves.rasterise(origin, shape)
    slices, owner = np.unique(curves.slice, return_inverse=True)
    rows, columns = (curves.frame.shape[axis] for axis in curves.frame.in_plane_axes)
    beyond = rows * columns - truth.shape[1] * truth.shape[2]  # background outside the window
    per_curve = sum_per_part(corner, curves.offsets)
    per_slice = np.bincount(owner, per_curve, len(slices))
    filled = corner_splines(curves, corner).sample().rasterise(origin, truth.shape)
    counts = confusion(truth, filled, axis=(1, 2))
    inside = counts.take(slices - int(origin[0]))
    each = replace(inside, tn=inside.tn + beyond)
    whole = each.together()
    row = {
        "corners": int(corner.sum()),
        "share": corner.sum() / len(corner),
        "too_few": float(np.mean(per_curve < FEWEST)),
        "corners_per_slice": float(np.median(per_slice)),
        "bytes_per_slice": 8 * float(np.median(per_slice)),
    }
    row |= {name: float(np.nanmedian(values)) for name, values in (each.printed | each.standard).items()}
    row |= {f"{name} (whole)": float(value) for name, value in (whole.printed | whole.standard).items()}
    return row
