from itertools import product

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from cccd_junctions.cut import minimum_cuts
from cccd_junctions.delaunay import build_graph
from cccd_junctions.energy import (
    EnergyWeights,
    energy_of_logits,
    energy_weights,
    inference_energy,
    least_energy,
)


def random_graph(rng, extent=20, count=50):
    return build_graph(np.unique(rng.integers(0, extent, (count, 2)), axis=0))


def random_logits(rng, graph):
    return rng.normal(0, 3, len(graph.triangles)), rng.normal(0, 3, len(graph.links))


def tensors(*arrays):
    return (torch.as_tensor(np.asarray(array, np.float64)) for array in arrays)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_training_and_inference_give_a_labelling_the_same_energy(seed):
    rng = np.random.default_rng(seed)
    graph = random_graph(rng)
    logits = random_logits(rng, graph)
    ours = inference_energy(graph, logits)
    weights = energy_weights(graph)
    theirs = energy_of_logits(
        EnergyWeights(*tensors(weights.unary, weights.pairwise)),
        *tensors(*logits),
        torch.nn.functional.softplus,
    )
    one, other = (rng.random(len(graph.triangles)) < 0.5 for _ in range(2))
    expected = ours.difference(one.astype(float), other.astype(float), graph.link_triangles.T)
    sides = torch.as_tensor(graph.link_triangles.T.astype(np.int64))
    assert float(theirs.difference(*tensors(one, other), sides)) == pytest.approx(
        expected, rel=1e-9, abs=1e-9
    )


def test_an_energy_is_unary_inside_and_pairwise_along_the_border():
    rng = np.random.default_rng(1)
    graph = random_graph(rng)
    inside_logit, link_logit = random_logits(rng, graph)
    energy = inference_energy(graph, (inside_logit, link_logit))
    labels = rng.random(len(graph.triangles)) < 0.4
    border = labels[graph.link_triangles[:, 0]] != labels[graph.link_triangles[:, 1]]
    doubt = np.log1p(np.exp(-link_logit))
    free = labels & ~graph.outer
    by_hand = (
        -(graph.areas[free] ** 0.75 * inside_logit[free]).sum() + (graph.link_lengths * doubt)[border].sum()
    )
    nothing = np.zeros(len(labels))
    assert energy.difference(labels.astype(float), nothing, graph.link_triangles.T) == pytest.approx(by_hand)


def test_no_labelling_has_less_energy_than_the_least():
    for seed in range(2):
        rng = np.random.default_rng(seed)
        graph = random_graph(rng, 5, 5)
        free = np.flatnonzero(~graph.outer)
        assert len(free) <= 12
        energy = inference_energy(graph, random_logits(rng, graph))
        found = least_energy(graph, energy)
        assert not found[graph.outer].any()
        for chosen in product([0.0, 1.0], repeat=len(free)):
            labels = np.zeros(len(graph.triangles))
            labels[free] = chosen
            assert energy.difference(found.astype(float), labels, graph.link_triangles.T) <= 1e-9


def test_cuts_that_go_on_from_another_are_those_from_the_start():
    rng = np.random.default_rng(2)
    graph = build_graph(np.unique(rng.integers(0, 30, (120, 2)), axis=0))
    unaries = rng.normal(size=(5, len(graph.triangles)))
    pairwise = rng.exponential(0.7, len(graph.links))
    together = minimum_cuts(unaries, pairwise, graph.link_triangles)
    for unary, found in zip(unaries, together, strict=True):
        alone = minimum_cuts([unary], pairwise, graph.link_triangles)[0]
        assert np.array_equal(found, alone)
        assert 0 < np.count_nonzero(alone) < len(alone)
