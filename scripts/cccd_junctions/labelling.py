"""Inside or outside for a slice's triangles: the least cut, or an alternative that is right as a whole."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cccd.geometry.arrays import BoolArray, FloatArray
from cccd_junctions.alternatives import FEATURES, alternatives, describe, pieces
from cccd_junctions.decoding import Outline, find_outline
from cccd_junctions.delaunay import DelaunayGraph
from cccd_junctions.energy import Logits, energy_weights, inference_energy, least_energy
from cccd_junctions.reranking import shipped_reranker
from cccd_junctions.uncertainty import areas_between, chance_of_error, doubt_facts

# What evidence from elsewhere, by the weights of its inside triangles, adds to the score of an alternative:
# of 0, 0.01, 0.02, 0.03, 0.05 and 0.1 the best on nine stacks of a development seed.
_EVIDENCE_SCORE = 0.02

#: Chance of error of the closed curves of a map in which the cut finds nothing: nobody knows.
_UNKNOWN = 0.5


@dataclass(frozen=True, eq=False)
class Labelled:
    """What is inside of a slice's graph.

    Attributes
    ----------
    inside : (T,) bool array
        Of its triangles.
    uncertainty : float or None
        Probability that its curves are wrong; ``None`` where alternatives were not weighed.
    """

    inside: BoolArray
    uncertainty: float | None


def label_slice(
    graph: DelaunayGraph,
    logits: Logits,
    parts: int | None = None,
    outline: Outline | None = None,
    evidence: FloatArray | None = None,
    rerank: bool = True,
) -> Labelled:
    """Label the triangles of one slice.

    Maps that are outlines already are taken as they are; so are closed curves where the cut finds nothing.

    Parameters
    ----------
    graph : DelaunayGraph
    logits : tuple of (T,) and (L,) arrays
    parts : int, optional
        Pieces at most, none of which has a hole: alternatives that keep to it go before the others.
    outline : Outline, optional
        Is found where it is not given.
    evidence : (T,) float64, optional
        Nats for inside from elsewhere, as from neighbouring slices.
    rerank : bool
        Whether alternatives of the least cut are weighed as a whole, and what they say of errors is reported.
        Half of the wrong maps have a right alternative, and half of these are found by it.
    """
    outline = find_outline(graph) if outline is None else outline
    if outline.exact:
        return Labelled(outline.enclosed, 0.0)
    evidence = np.zeros(len(graph.triangles)) if evidence is None else evidence
    logits = logits[0] + evidence, logits[1]
    energy = inference_energy(graph, logits)
    cut = least_energy(graph, energy)
    if not cut.any():
        return Labelled(outline.enclosed, _UNKNOWN if rerank else None)
    if not rerank:
        return Labelled(cut, None)
    weights = energy_weights(graph)
    labels = alternatives(graph, energy, weights, cut)
    features = describe(graph, logits, energy, labels)
    reranker = shipped_reranker()
    own = reranker.scores(features)
    scores = own + _EVIDENCE_SCORE * (labels @ (weights.unary * evidence))
    if parts is not None:
        found, holes = pieces(features)
        fitting = (found <= parts) & (holes == 0)
        scores[~fitting & fitting.any()] = -np.inf
    chosen = int(scores.argmax())
    size = float(features[0, FEATURES.index("size")])
    facts = doubt_facts(scores, float(own[0]), areas_between(graph, labels, chosen), size)
    return Labelled(labels[chosen], float(chance_of_error(facts, reranker.doubt)))
