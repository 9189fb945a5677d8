"""The run's networks as comparisons use them: each orders boundary pixels into curves."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

from cccd.containers import Boundaries, Curves
from cccd.geometry.arrays import BoolArray, IntArray, RealArray


class Orderer(Protocol):
    """Orders boundary pixels into closed curves."""

    def __call__(
        self,
        boundaries: Boundaries,
        image: RealArray | None = None,
        image_origin: Sequence[int] | IntArray = (0, 0, 0),
        region: BoolArray | None = None,
    ) -> Curves:
        """Order; an image (S, I, J), whose first voxel is ``image_origin``, is read beside the pixels.

        So is a rough region, on the image's grid.
        """
        ...


def load_orderers(*paths: str | Path) -> list[Orderer]:
    """Load the junction networks that the run uses, each to order boundary pixels with.

    Only here do the comparisons of curves and surfaces need torch, and only where there is a network.
    """
    return [_load_orderer(path) for path in paths]


def _load_orderer(path: str | Path) -> Orderer:
    from cccd_junctions.checkpoint import load_model
    from cccd_junctions.ordering import order_boundaries

    model = load_model(path)

    def order(
        boundaries: Boundaries,
        image: RealArray | None = None,
        image_origin: Sequence[int] | IntArray = (0, 0, 0),
        region: BoolArray | None = None,
    ) -> Curves:
        return order_boundaries(boundaries, model, image, image_origin, region=region)[0]

    return order
