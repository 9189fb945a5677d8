"""Inside or outside for a slice's triangles: the least cut, or an alternative that is right as a whole."""

from __future__ import annotations

import numpy as np

from cccd.geometry.arrays import BoolArray, FloatArray
from cccd.junctions.alternatives import alternatives, describe, pieces
from cccd.junctions.decoding import Outline, find_outline
from cccd.junctions.delaunay import DelaunayGraph
from cccd.junctions.energy import Logits, energy_weights, inference_energy, least_energy
from cccd.junctions.parts import limit_parts
from cccd.junctions.reranking import shipped_reranker
from cccd.settings.junctions import InferenceSettings

__all__ = ["label_inside"]


def label_inside(
    graph: DelaunayGraph,
    logits: Logits,
    settings: InferenceSettings,
    outline: Outline | None = None,
    evidence: FloatArray | None = None,
) -> BoolArray:
    """Inside triangles (T,) of one slice, in as many pieces as there may be.

    Maps that are outlines already are taken as they are; so are closed curves where the cut finds nothing.

    Parameters
    ----------
    graph : DelaunayGraph
    logits : tuple of (T,) and (L,) arrays
    settings : InferenceSettings
    outline : Outline, optional
        Is found where it is not given.
    evidence : (T,) float64, optional
        Nats for inside from elsewhere, as from neighbouring slices.
    """
    outline = find_outline(graph, settings) if outline is None else outline
    if outline.exact:
        return outline.enclosed
    evidence = np.zeros(len(graph.triangles)) if evidence is None else evidence
    logits = logits[0] + evidence, logits[1]
    energy = inference_energy(graph, logits, settings)
    cut = limit_parts(graph, energy, least_energy(graph, energy), settings)
    if not cut.any():
        return outline.enclosed
    if not settings.rerank:
        return cut
    weights = energy_weights(graph, settings)
    labels = alternatives(graph, energy, weights, cut)
    if len(labels) == 1:
        return cut
    features = describe(graph, logits, energy, labels, settings)
    scores = shipped_reranker().scores(features) + settings.neighbour_score * (
        labels @ (weights.unary * evidence)
    )
    if settings.parts is not None:
        parts, holes = pieces(features)
        scores[1:][(parts[1:] > settings.parts) | (holes[1:] > 0)] = -np.inf
    return labels[scores.argmax()]
