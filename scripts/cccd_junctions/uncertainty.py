"""How likely a slice's curves are wrong: by what the alternatives of its least cut are worth.

Little speaks for a slice where the cut itself scores low as a whole, or where labellings that are likely too
enclose something else; and a small organ is wrong the sooner. A logistic curve, fitted to maps that the
ranking has not seen (`cccd_training.junctions.reranker`), makes a probability of this. From which
probability on slices are listed is calibrated on kinds of damage that training never saw, so that on a
further kind few of the others are wrong (`cccd_calibration.doubts`).
"""

from __future__ import annotations

import numpy as np

from cccd.geometry.arrays import BoolArray, FloatArray, RealArray
from cccd_junctions.delaunay import DelaunayGraph

#: What `doubt_facts` gives, in order.
FACTS = ("expected change", "size", "score of the cut")

#: The share of wrong slices among those that are not listed, and the chance of error from which on slices are
#: listed for it: conformal risk control over 15 kinds of damage, 300 maps of each (docs/doubts.csv).
LISTED_FROM = ((0.075, 0.0055), (0.1, 0.019), (0.15, 0.0502), (0.2, 0.1052), (0.3, 0.289))
#: The network's weights that this holds for (`cccd_junctions.network.JunctionNetwork.weights_sha256`).
CALIBRATED_WEIGHTS = "b5621413385ed026eb63493a5796a79f242d6dc2b09de93ecfa6b4a1cbe35341"


def listed_from(unlisted_wrong: float) -> float:
    """Return the chance of error from which on a slice is listed; 0, which lists all, below the first share.

    Parameters
    ----------
    unlisted_wrong : float
        Share of wrong slices among those that are not listed, at most, on the mean of kinds of damage.

    Examples
    --------
    >>> listed_from(0.01), listed_from(0.1) == listed_from(0.12) < listed_from(0.2)
    (0.0, True)
    """
    return max((level for share, level in LISTED_FROM if share <= unlisted_wrong), default=0.0)


def areas_between(graph: DelaunayGraph, labels: BoolArray, chosen: int) -> FloatArray:
    """Areas (K,) in square pixels in which labellings (K, T) differ from one of them."""
    return (labels ^ labels[chosen]) @ np.where(graph.outer, 0, graph.areas)


def doubt_facts(scores: RealArray, cut_score: float, apart_px: RealArray, size: float) -> FloatArray:
    """List `FACTS` (3,) of a slice.

    Parameters
    ----------
    scores : (K,) array
        Of its labellings, the evidence of neighbours among them; minus infinity where one is ruled out.
    cut_score : float
        Of the least cut, by the network alone.
    apart_px : (K,) array
        `areas_between` the labellings and the chosen one.
    size : float
        Logarithm of the square root of the area in pixels.

    Examples
    --------
    Of two labellings that are equally likely, the other has 99 pixels more:

    >>> doubt_facts(np.array([2.0, 2.0]), 2.0, np.array([0, 99]), 3.0).round(2).tolist()
    [2.3, 3.0, 2.0]
    """
    likely = np.exp(scores.astype(float) - scores.max())
    return np.array([likely @ np.log1p(apart_px) / likely.sum(), size, cut_score])


def chance_of_error(facts: FloatArray, weights: RealArray) -> FloatArray:
    """Estimate how probable it is that curves are wrong (`cccd_training.junctions.scoring`).

    Parameters
    ----------
    facts : (..., 3) array
    weights : (4,) array
        Of the facts, and the log odds where all are zero (`cccd_junctions.reranking.Reranker.doubt`).

    Examples
    --------
    >>> chance_of_error(np.array([[0, 4, 3], [3, 4, 0]]), np.array([1, -1.5, -1, 6])).round(2).tolist()
    [0.05, 0.95]
    """
    odds = facts @ weights[:-1].astype(float) + float(weights[-1])
    return 1 / (1 + np.exp(-odds))
