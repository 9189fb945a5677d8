"""The k that the paper's figures show; what computes them and what draws them read it here."""

from __future__ import annotations

__all__ = ["COARSE_K", "OUTLINES"]

#: k at which the paper compares two organs (Figure 12).
COARSE_K = 20

#: The outlines that figures show, by k.
OUTLINES = {"figure10": (3, 5, 7, 20), "figure12": (COARSE_K,), "figure14": (3, 7, 12)}
