"""Curve reconstructions: points (N, 2) in, links (M, 2) between point numbers out."""

from __future__ import annotations

import numpy as np

from cccd_paper.comparisons.baselines import Baseline
from cccd_paper.comparisons.links import unique_links
from cccd_paper.comparisons.reconstruction.connect2d import connect2d
from cccd_paper.comparisons.reconstruction.crawl import crawl
from cccd_paper.comparisons.reconstruction.crust import crust
from cccd_paper.comparisons.reconstruction.gathan import gathan
from cccd_paper.comparisons.reconstruction.hnn_crust import hnn_crust
from cccd_paper.comparisons.reconstruction.nn_crust import nn_crust
from cccd_paper.comparisons.reconstruction.peel import peel
from cccd_paper.comparisons.reconstruction.sigdt import sigdt
from cccd_paper.comparisons.reconstruction.tour import tour

RECONSTRUCTIONS = {
    "connect2d": Baseline("Connect2D", connect2d, "written from the publication; order of steps ours"),
    "crawl": Baseline("Crawl", crawl, "written from the publication"),
    "nn_crust": Baseline("NN-Crust", nn_crust, "written from the publication"),
    "crust": Baseline("Crust", crust, "written from the publication"),
    "peel": Baseline("Peel", peel, "written from the publication, without its outlier removal"),
    "gathan": Baseline("Gathan", gathan, "our reading of its conditions; do not quote"),
    "sigdt": Baseline("SIGDT", sigdt, "written from the publication, with Connect2D's adjustment"),
    "hnn_crust": Baseline("HNN-Crust", hnn_crust, "written from the publication"),
    "tour": Baseline("2-opt tour", tour, "greedy, 2-opt and Or-opt"),
}


def reconstruct(method: str, points: np.ndarray) -> np.ndarray:
    """Links (M, 2) of a registered reconstruction, whatever order the points come in.

    Equal lengths are everywhere on a pixel grid; so that ties do not hang on the order of the input,
    the points are put in raster order first. Repeated points are used once.

    Parameters
    ----------
    method : str
        Key of `RECONSTRUCTIONS`.
    points : (N, 2) float

    Returns
    -------
    (M, 2) int64
        Pairs of numbers of the points as given, ascending.
    """
    distinct, original = np.unique(np.asarray(points, float).reshape(-1, 2), axis=0, return_index=True)
    if len(distinct) < 2:
        return np.zeros((0, 2), np.int64)
    return unique_links(original[RECONSTRUCTIONS[method].run(distinct)])
