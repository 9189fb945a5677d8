"""What training minimises: cross entropies of triangles and links, and the excess energy of the truth."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor, nn
from torch_geometric.data import HeteroData

from cccd.geometry.arrays import BoolArray, FloatArray, offsets_of, split_ragged
from cccd_junctions.delaunay import DelaunayGraph
from cccd_junctions.energy import Energy, EnergyWeights, energy_of_logits, least_energy
from cccd_junctions.graph_data import TRIANGLE_LINKS

# Weight of the cut's loss beside the cross entropies: 0, 1 and 3 gave 0.511, 0.526 and 0.530 correct on 570
# maps; chosen beyond them.
_CUT_WEIGHT = 4.0

# Nats by which the true labels should win, per triangle by extent: a logit of 2 is right seven times in
# eight.
_MARGIN = 2.0


def total_loss(logits: tuple[Tensor, Tensor], batch: HeteroData) -> Tensor:
    """Mean over slices of the triangles' and the links' cross entropy, and the loss of the cut.

    Parameters
    ----------
    logits : tuple of (T,) and (L,)
        That a triangle is inside and that a link is true.
    batch : Batch
        Of slices from `cccd_training.junctions.data.label_map`.
    """
    inside, link = logits
    entropies = [
        nn.functional.binary_cross_entropy_with_logits(logit, part.y, part.weight, reduction="sum")
        for logit, part in ((inside, batch["triangle"]), (link, batch["link"]))
    ]
    return sum(entropies) / batch.num_graphs + _CUT_WEIGHT * cut_loss(inside, link, batch, _MARGIN)


def cut_loss(inside: Tensor, link: Tensor, batch: HeteroData, margin: float) -> Tensor:
    """How much more energy the true labels have than the least: the structured hinge loss.

    The least is sought with every wrong triangle ``margin`` nats cheaper, so that the true labels win by a
    margin (Tsochantaridis et al. 2005; Szummer, Kohli and Hoiem 2008 for graph cuts). Mean over triangles
    by extent. The energy is that of inference: `cccd_junctions.energy`.
    """
    triangles = batch["triangle"]
    extent, share = triangles.energy_weight, triangles.y
    weights = EnergyWeights(extent, batch["link"].energy_weight)
    energy = energy_of_logits(weights, inside, link, nn.functional.softplus)
    cheapened = Energy(energy.unary - margin * extent * (1 - 2 * share), energy.pairwise)
    truth = (share > 0.5) & (extent > 0)
    found = torch.as_tensor(_least(cheapened, batch)).to(inside.device)
    excess = cheapened.difference(truth.float(), found.float(), batch[TRIANGLE_LINKS].edge_index)
    return excess / extent.sum()


def _least(energy: Energy[Tensor], batch: HeteroData) -> BoolArray:
    """Labels (T,) of the least energy, slice by slice."""
    graphs: list[DelaunayGraph] = batch.graph
    unary = split_ragged(_doubles(energy.unary), offsets_of([len(graph.triangles) for graph in graphs]))
    pairwise = split_ragged(_doubles(energy.pairwise), offsets_of([len(graph.links) for graph in graphs]))
    slices = zip(graphs, unary, pairwise, strict=True)
    return np.concatenate([least_energy(graph, Energy(one, other)) for graph, one, other in slices])


def _doubles(values: Tensor) -> FloatArray:
    return values.detach().double().cpu().numpy()
