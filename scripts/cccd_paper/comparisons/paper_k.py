"""Names of methods and the k that the paper's figures show, for what computes them and what draws them."""

from __future__ import annotations

#: Our method's name in tables and figures.
CCCD = "Proposed CCCD"

#: The row of splines that choose their own control points, beside those of every k.
AUTOMATIC = "automatic"

#: k at which the paper compares two organs (Figure 12).
COARSE_K = 20

#: k of which Table 3 prints points and bytes: the corners that are lofted to a surface.
TABLE_3 = (3, 7, 12)

#: The outlines that figures show, by k.
OUTLINES = {"figure10": (3, 5, 7, 20), "figure12": (COARSE_K,), "figure14": TABLE_3}

#: CCCD's settings in Figure 11.
FIGURE_11 = ("k = 3", "k = 5", "k = 7", "k = 20")

#: For what a tuned baseline's setting was taken, as the column ``chosen`` says.
BEST, AS_SMOOTH, DEFAULTS = "best ASSD", "as smooth as ours", "its defaults"
#: What bends at most so many times as ours counts as as smooth.
AS_SMOOTH_SLACK = 1.05
#: The distances between our splines, learned filling included, without a surface's own splines: ours, and no
#: baseline.
DISTANCES = "CCCD, distances alone + windowed sinc"
