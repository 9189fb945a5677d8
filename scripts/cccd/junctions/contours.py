"""The junction network orders boundary pixels: of boundary maps, and of edges found in grey images.

A mask needs no network, for border following is exact (`cccd.contours`); the network earns its cost on
maps with spurs, bridges and gaps.
"""

from __future__ import annotations

from typing import Any

from cccd.containers import Boundaries, Curves, Structure
from cccd.contours import check_closed
from cccd.errors import InputError
from cccd.junctions.inference import LoopPredictor, Predictor
from cccd.junctions.ordering import DEFAULTS, order_boundaries
from cccd.settings.junctions import InferenceSettings

__all__ = ["order_contours"]


def order_contours(
    structure: Structure,
    boundaries: Boundaries,
    model: Predictor | LoopPredictor,
    settings: InferenceSettings = DEFAULTS,
) -> tuple[Curves, dict[str, Any]]:
    """Order the boundary pixels of every slice into closed simple curves.

    Parameters
    ----------
    structure : Structure
        Its image, and the rough region in it, are read beside the pixels, where it has them.
    boundaries : Boundaries
        Its boundary pixels.
    model : Predictor or LoopPredictor
        From `cccd.junctions.checkpoint.load_model`.
    settings : InferenceSettings

    Returns
    -------
    curves : Curves
        Closed, simple, oriented.
    report : dict
        Plain JSON: ``method``, and the counts of `cccd.junctions.order_boundaries`.

    Raises
    ------
    InputError
        The structure has drawn contours, which are ordered already, or no slice has a closed boundary.
    """
    if structure.contours is not None:
        raise InputError(
            f"{structure.case}/{structure.organ}",
            "its contours are drawn, and need no ordering",
            "its file has changed since the run was planned: run snakemake again",
        )
    curves, report = order_boundaries(
        boundaries,
        model,
        structure.stack("image"),
        structure.stack_origin,
        settings,
        structure.stack("region"),
    )
    return check_closed(curves, structure), {"method": "GNN", **report}
