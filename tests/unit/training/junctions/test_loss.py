from itertools import product

import numpy as np
import pytest
import torch
from torch_geometric.data import Batch

from cccd_training.junctions.data import label_map
from cccd_training.junctions.loss import cut_loss
from cccd_training.junctions.synthetic_maps import SyntheticMap

MARGIN = 2.0
SQUARE = np.array([(0, 0), (0, 4), (4, 4), (4, 0)])


@pytest.fixture
def examples():
    """A square whose middle pixel belongs to nothing: four triangles inside."""
    pixels = np.vstack([SQUARE, [(2, 2)]]).astype(np.int32) + 20
    drawn = SyntheticMap(pixels, [SQUARE.astype(np.int32) + 20], "clean", (45, 45))
    return Batch.from_data_list([label_map(drawn, False)])


def energy(examples, inside, link, labels):
    (graph,) = examples.graph
    gain = np.asarray(inside) * examples["triangle"].energy_weight.numpy()
    cost = examples["link"].energy_weight.numpy() * np.logaddexp(0, -np.asarray(link))
    border = labels[graph.link_triangles[:, 0]] != labels[graph.link_triangles[:, 1]]
    return (gain * labels).sum() - (cost * border).sum()


def test_it_is_the_margin_by_which_the_best_of_all_labellings_beats_the_true_one(examples):
    rng = np.random.default_rng(0)
    (graph,), extent = examples.graph, examples["triangle"].energy_weight.numpy()
    free = np.flatnonzero(~graph.outer)
    truth = (examples["triangle"].y.numpy() > 0.5) & ~graph.outer
    for _ in range(20):
        inside, link = rng.normal(0, 3, len(graph.triangles)), rng.normal(0, 3, len(graph.links))
        best = -np.inf
        for chosen in product([False, True], repeat=len(free)):
            labels = np.zeros(len(graph.triangles), bool)
            labels[free] = chosen
            wrong = (
                MARGIN * extent * (1 - 2 * examples["triangle"].y.numpy()) * (labels.astype(float) - truth)
            )
            best = max(best, energy(examples, inside, link, labels) + wrong.sum())
        expected = (best - energy(examples, inside, link, truth)) / extent.sum()
        found = cut_loss(torch.from_numpy(inside).float(), torch.from_numpy(link).float(), examples, MARGIN)
        assert float(found) == pytest.approx(expected, rel=1e-4, abs=1e-5)


def test_it_is_zero_for_sure_and_right_logits_and_falls_along_its_gradient(examples):
    sure = torch.where(examples["triangle"].y > 0.5, 9.0, -9.0)
    links = torch.where(examples["link"].y > 0.5, 9.0, -9.0)
    assert float(cut_loss(sure, links, examples, MARGIN)) == pytest.approx(0, abs=1e-4)
    wrong = (-sure / 9).requires_grad_()
    found = cut_loss(wrong, links, examples, MARGIN)
    found.backward()
    better = (wrong - 0.1 * wrong.grad).detach()
    assert cut_loss(better, links, examples, MARGIN) < found
