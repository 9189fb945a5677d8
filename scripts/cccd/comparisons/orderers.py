"""The run's networks as comparisons use them: each orders boundary pixels into curves."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from cccd.containers import Boundaries, Curves

__all__ = ["Orderer", "load_orderers"]

#: Orders boundary pixels into closed curves.
Orderer = Callable[[Boundaries], Curves]


def load_orderers(*paths: str | Path) -> list[Orderer]:
    """Load the junction networks that the run uses, each to order boundary pixels with.

    Only here do the comparisons of curves and surfaces need torch, and only where there is a network.
    """
    return [_load_orderer(path) for path in paths]


def _load_orderer(path: str | Path) -> Orderer:
    from cccd.junctions import order_boundaries
    from cccd.junctions.checkpoint import load_model

    model = load_model(path)
    return lambda boundaries: order_boundaries(boundaries, model)[0]
