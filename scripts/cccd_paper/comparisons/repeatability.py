"""How well corner detectors find the same corners again: under rotation, scale and noise.

The measure is the one the field uses (Mohanna and Mokhtarian 2006; Awrangjeb and Lu 2008): corners of
the original outline are carried over by the known transform and looked for within a few pixels among
those of the transformed one; R is the mean of the two shares found, so that many corners do not pay.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import pandas as pd
from scipy.spatial import cKDTree

from cccd.containers import Curves, Frame
from cccd.contours import trace_stack
from cccd.geometry.raster import rasterise
from cccd_paper.comparisons.chain_corners import DETECTORS

#: What changes an outline.
CHANGES = ("rotation", "scale", "noise")

Detector = Callable[[np.ndarray, np.ndarray], np.ndarray]


def repeatability(
    curves: Curves,
    rng: np.random.Generator,
    detectors: Mapping[str, Detector] = DETECTORS,
    rotations: Sequence[float] = (10, 25, 45, 70, 90),
    scales: Sequence[float] = (0.5, 0.75, 1.5, 2.0),
    noises: Sequence[float] = (0.25, 0.5, 1.0),
    within_px: float = 3.0,
) -> pd.DataFrame:
    """Measure the repeatability of corner detectors on outlines of organs.

    Parameters
    ----------
    curves : Curves
        Each curve is taken alone, as a filled outline that is drawn and traced anew after the change.
    rng : Generator
        For the noise.
    detectors : mapping
        Name -> ``(points, offsets) -> bool`` per point.
    rotations : sequence of float
        Degrees about the outline's centre.
    scales : sequence of float
    noises : sequence of float
        Standard deviation in pixels of the displacement of every boundary point.
    within_px : float
        How near a corner must be to count as the same, in pixels of the original outline.

    Returns
    -------
    DataFrame
        ``detector``, ``change`` (rotation, scale, noise), ``amount``, ``corners`` (mean number found in
        the changed outline) and ``repeatability`` (mean over the curves that have corners, 0 to 1).
    """
    changes = [("rotation", amount) for amount in rotations]
    changes += [("scale", amount) for amount in scales]
    changes += [("noise", amount) for amount in noises]
    originals = [_redraw(points, np.eye(2), 0.0, rng) for points in curves]
    table = []
    for change, amount in changes:
        linear = _linear(change, amount)
        sigma = float(amount) if change == "noise" else 0.0
        pairs = [(points, _redraw(points, linear, sigma, rng)) for points in originals if len(points)]
        pairs = [pair for pair in pairs if len(pair[1])]
        radius = within_px * np.sqrt(abs(np.linalg.det(linear)))
        for name, detect in detectors.items():
            shares, counts = [], []
            for before, after in pairs:
                kept = before[detect(before, np.array([0, len(before)]))] @ linear.T
                found = after[detect(after, np.array([0, len(after)]))]
                shares.append(_agreement(kept, found, radius))
                counts.append(len(found))
            score = np.nanmean(shares) if np.isfinite(shares).any() else np.nan
            table.append((name, change, amount, np.mean(counts), score))
    return pd.DataFrame(table, columns=["detector", "change", "amount", "corners", "repeatability"])


def _linear(change: str, amount: float) -> np.ndarray:
    """Linear map (2, 2) of a change."""
    if change == "rotation":
        angle = np.radians(amount)
        return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return np.eye(2) * (amount if change == "scale" else 1.0)


def _redraw(points: np.ndarray, linear: np.ndarray, sigma: float, rng: np.random.Generator) -> np.ndarray:
    """Largest outline (n, 2) of a polygon after it was moved, disturbed and drawn on the grid again."""
    moved = points @ linear.T
    if sigma > 0:
        moved = moved + rng.normal(0, sigma, moved.shape)
    origin = np.floor(moved.min(axis=0)).astype(int) - 2
    rows, columns = (int(n) for n in np.ceil(moved.max(axis=0)).astype(int) + 3 - origin)
    filled = rasterise([moved], origin, (rows, columns))
    # the frame plays no part: the outline is wanted in the polygon's own coordinates
    traced = trace_stack(filled[None], (0, *origin), Frame(np.eye(4), 0, (1, rows, columns)))
    return next(iter(traced), np.zeros((0, 2)))


def _agreement(kept: np.ndarray, found: np.ndarray, radius: float) -> float:
    """Mean of the shares of two sets of corners that have a partner in the other set."""
    if len(kept) == 0 and len(found) == 0:
        return np.nan  # nothing to find again
    if len(kept) == 0 or len(found) == 0:
        return 0.0
    forth = cKDTree(found).query(kept)[0] <= radius
    back = cKDTree(kept).query(found)[0] <= radius
    return float(np.mean(forth) + np.mean(back)) / 2
