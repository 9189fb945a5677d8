"""Every planar method that CCCD is compared with, under one roof.

A corner detector takes an 8-bit image (I, J) and gives corner pixels (K, 2). A reconstruction takes
points (N, 2) and gives links (M, 2) between point numbers. A contour takes corner points (K, 2) or an
image, and a seed circle, and gives an ordered closed curve (n, 2). To add a method, write its function
in a file of its own and add one line here. Decoders of boundary maps (pixels and a seed in, ordered
closed curve out) are listed by `DECODERS` in their own file.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cccd.comparisons.active_contour import b_spline_snake, image_snake
from cccd.comparisons.decoders import DECODERS
from cccd.comparisons.links import unique_links
from cccd.comparisons.pixel_corners import fast, harris, shi_tomasi, susan
from cccd.comparisons.reconstruction.connect2d import connect2d
from cccd.comparisons.reconstruction.crawl import crawl
from cccd.comparisons.reconstruction.crust import crust
from cccd.comparisons.reconstruction.gathan import gathan
from cccd.comparisons.reconstruction.hnn_crust import hnn_crust
from cccd.comparisons.reconstruction.nn_crust import nn_crust
from cccd.comparisons.reconstruction.peel import peel
from cccd.comparisons.reconstruction.sigdt import sigdt
from cccd.comparisons.reconstruction.tour import tour

__all__ = ["CONTOURS", "CORNER_DETECTORS", "DECODERS", "RECONSTRUCTIONS", "Method", "reconstruct"]


@dataclass(frozen=True)
class Method:
    """A method as the tables name it.

    Attributes
    ----------
    title : str
        Name in tables and figures.
    run : callable
        The function (see the module's first lines for the signatures).
    note : str
        How this version relates to the authors': shown under the tables.
    """

    title: str
    run: Callable
    note: str


CORNER_DETECTORS = {
    "harris": Method("FUSE1 (Harris)", harris, "OpenCV"),
    "shi_tomasi": Method("FUSE2 (Shi-Tomasi)", shi_tomasi, "OpenCV"),
    "fast": Method("FUSE3 (FAST)", fast, "OpenCV"),
    "susan": Method("SUSAN + B-spline", susan, "written from the publication"),
}

RECONSTRUCTIONS = {
    "connect2d": Method("Connect2D", connect2d, "written from the publication; order of steps ours"),
    "crawl": Method("Crawl", crawl, "written from the publication"),
    "nn_crust": Method("NN-Crust", nn_crust, "written from the publication"),
    "crust": Method("Crust", crust, "written from the publication"),
    "peel": Method("Peel", peel, "written from the publication, without its outlier removal"),
    "gathan": Method("Gathan", gathan, "our reading of its conditions; do not quote"),
    "sigdt": Method("SIGDT", sigdt, "written from the publication, with Connect2D's adjustment"),
    "hnn_crust": Method("HNN-Crust", hnn_crust, "written from the publication"),
    "tour": Method("2-opt tour", tour, "greedy, 2-opt and Or-opt"),
}

CONTOURS = {
    "corners": Method("B-spline snake on corners", b_spline_snake, "as the paper used Marsousi et al."),
    "grey": Method("B-spline snake on the image", image_snake, "after Marsousi et al., forces ours"),
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
