"""Corner detectors at equal numbers of points: each has the best parameters for every share of the pixels.

A Dice alone favours what marks more pixels. Here every detector may use at most a share of the outline's
pixels, its parameters are the best within that share on training slices, and it is measured on others. On
images the corners come in their true order, so that the detector is judged and not the ordering.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from cccd.containers import Frame
from cccd_paper.comparisons.baselines.corner_detectors import CORNER_DETECTORS
from cccd_paper.comparisons.chain_corners import DETECTORS
from cccd_paper.comparisons.corner_comparison import fuse
from cccd_paper.comparisons.corner_measures import measure_corners
from cccd_paper.comparisons.parameters import LARGEST_SHARE
from cccd_paper.comparisons.samples import SliceSample, outer_curves

#: The shares of the pixels that are compared; the last is the paper's at k = 3.
SHARES = (0.05, 0.1, 0.15, 0.2, 0.3, LARGEST_SHARE)

#: What stands for the image of detectors that read the chain code.
CHAIN = "chain code"


def choose_for_shares(scores: pd.DataFrame, shares: Sequence[float] = SHARES) -> pd.DataFrame:
    """Choose each detector's best parameters within every share of the pixels.

    Parameters
    ----------
    scores : DataFrame
        ``image``, ``detector``, ``parameters``, ``DSC``, ``share``, and ``found`` where a detector may mark
        pixels off the boundary, as `corner_comparison.search` and `k_sweep.search_chain` give them.
    shares : sequence of float

    Returns
    -------
    DataFrame
        Rows of ``scores`` with the share that they were chosen for, ``at_most``. A detector none of whose
        parameters are within a share has no row there.
    """
    few = scores[scores["found"].fillna(0) <= 1] if "found" in scores else scores
    chosen = [few[few["share"] <= share].assign(at_most=share) for share in shares]
    ranked = pd.concat(chosen).sort_values(["DSC", "share"], ascending=[False, True], kind="stable")
    best = ranked.groupby(["at_most", "image", "detector"], sort=True).head(1)
    return best.sort_values(["image", "detector", "at_most"], ignore_index=True)


def measure_at_shares(samples: Sequence[SliceSample], frame: Frame, chosen: pd.DataFrame) -> pd.DataFrame:
    """Measure the parameters that were chosen on slices of another structure.

    Parameters
    ----------
    samples : sequence of SliceSample
    frame : Frame
    chosen : DataFrame
        From `choose_for_shares`.

    Returns
    -------
    DataFrame
        ``image``, ``detector``, ``at_most``, ``values`` of the parameters, and medians over the slices of
        the ``share`` of the pixels that are control points and of the Dice score ``DSC``.
    """
    rows = []
    for one in chosen.to_dict("records"):
        measure = _on_chain if one["image"] == CHAIN else _on_image
        share, score = measure(samples, frame, one)
        values = ", ".join(f"{name} {value}" for name, value in one["parameters"].items())
        names = {name: one[name] for name in ("image", "detector", "at_most")}
        rows.append(names | {"values": values, "share": share, "DSC": score})
    return pd.DataFrame(rows)


def _on_chain(samples: Sequence[SliceSample], frame: Frame, one: dict) -> tuple[float, float]:
    """Share of the pixels and Dice of a detector on the chain code."""
    curves = outer_curves([sample.curve for sample in samples], range(len(samples)), frame)
    corner = DETECTORS[one["detector"]](curves.points, curves.offsets, **one["parameters"])
    measured = measure_corners(curves, corner)
    return float(measured["share"]), float(measured["DSC"])


def _on_image(samples: Sequence[SliceSample], _: Frame, one: dict) -> tuple[float, float]:
    """Share of the pixels and Dice of a detector on an image; NaN where a slice has no such image."""
    found = []
    for sample in samples:
        if one["image"] not in sample.images:
            return np.nan, np.nan
        detect = CORNER_DETECTORS[one["detector"]].run
        fused = fuse(sample, detect(sample.images[one["image"]], **one["parameters"]), "chain")
        found.append((len(fused.used) / len(sample.curve), sample.dice_percent(fused.spline) / 100))
    share, score = np.median(found, axis=0)
    return float(share), float(score)
