"""How likely a slice's curves are wrong: by the margin of the cut.

The cut is sought twice more, with every triangle's logit shifted towards inside and towards outside. Where
the labels stay the same the answer is clear; the widest place of the zone in which they do not measures how
much hangs on a few nats. A logistic curve makes a probability of that width.
"""

from __future__ import annotations

import numpy as np

from cccd.geometry.arrays import AnyArray, FloatArray
from cccd.geometry.opencv import distance_to_zero
from cccd.junctions.decoding import fill_inside
from cccd.junctions.delaunay import DelaunayGraph
from cccd.junctions.energy import Logits, energy_weights, inference_energy, least_energies
from cccd.settings.junctions import InferenceSettings

__all__ = ["chance_of_error", "open_width"]


def open_width(graph: DelaunayGraph, logits: Logits, settings: InferenceSettings) -> float:
    """Measure half the width, in pixels, of what a shift by ``doubt_nats`` changes, at its widest place."""
    energy = inference_energy(graph, logits, settings)
    shift = settings.doubt_nats * energy_weights(graph, settings).unary
    least = least_energies(graph, [energy.unary + shift, energy.unary - shift], energy.pairwise)
    fewest, most = fill_inside(graph, *least)[0]
    zone = fewest ^ most
    return float(distance_to_zero(zone.astype(np.uint8)).max()) if zone.any() else 0.0


def chance_of_error(open_px: AnyArray, settings: InferenceSettings) -> FloatArray:
    """Estimate the probability (S,) that curves are wrong (`cccd.junctions.scoring`) from open widths (S,).

    Examples
    --------
    >>> chance_of_error(np.array([0, 2, 6]), InferenceSettings()).round(2).tolist()
    [0.0, 0.17, 0.78]
    """
    score = settings.doubt_offset + settings.doubt_slope * np.log1p(open_px)
    return 1 / (1 + np.exp(-score))
