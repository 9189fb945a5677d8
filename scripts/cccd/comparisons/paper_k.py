"""CCCD's name and the k that the paper's figures show, for what computes them and what draws them."""

from __future__ import annotations

__all__ = ["AUTOMATIC", "CCCD", "COARSE_K", "FIGURE_11", "OUTLINES"]

#: Our method's name in tables and figures.
CCCD = "Proposed CCCD"

#: The row of splines that choose their own control points, beside those of every k.
AUTOMATIC = "automatic"

#: k at which the paper compares two organs (Figure 12).
COARSE_K = 20

#: The outlines that figures show, by k.
OUTLINES = {"figure10": (3, 5, 7, 20), "figure12": (COARSE_K,), "figure14": (3, 7, 12)}

#: CCCD's settings in Figure 11; with the three fused methods they make seven series.
FIGURE_11 = ("k = 3", "k = 5", "k = 7", "k = 20")
