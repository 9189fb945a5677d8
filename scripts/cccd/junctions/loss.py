"""What training minimises: cross entropies of triangles and links, and the excess energy of the truth."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from cccd.geometry.arrays import FloatArray
from cccd.junctions.data import Examples
from cccd.junctions.energy import Energy, energy_of_logits, least_energy
from cccd.settings.junctions import LossSettings

__all__ = ["cut_loss", "total_loss"]


def total_loss(logits: tuple[Tensor, Tensor], examples: Examples, settings: LossSettings) -> Tensor:
    """Mean over slices of the triangles' and the links' cross entropy, and the loss of the cut.

    Parameters
    ----------
    logits : tuple of (T,) and (L,)
        That a triangle is inside and that a link is true.
    examples : Examples
    settings : LossSettings
    """
    inside, link = logits
    cross_entropy = nn.functional.binary_cross_entropy_with_logits
    triangles = cross_entropy(inside, examples.inside, examples.inside_weight, reduction="sum")
    links = cross_entropy(link, examples.true, examples.true_weight, reduction="sum")
    return triangles + links + settings.cut_weight * cut_loss(inside, link, examples, settings.margin)


def cut_loss(inside: Tensor, link: Tensor, examples: Examples, margin: float) -> Tensor:
    """How much more energy the true labels have than the least: the structured hinge loss.

    The least is sought with every wrong triangle ``margin`` nats cheaper, so that the true labels win by a
    margin (Tsochantaridis et al. 2005; Szummer, Kohli and Hoiem 2008 for graph cuts). Mean over triangles
    by extent. The energy is that of inference: `cccd.junctions.energy`.
    """
    extent, share = examples.energy_weights.unary, examples.inside
    energy = energy_of_logits(examples.energy_weights, inside, link, nn.functional.softplus)
    cheapened = Energy(energy.unary - margin * extent * (1 - 2 * share), energy.pairwise)
    least = least_energy(examples.graph, Energy(_doubles(cheapened.unary), _doubles(cheapened.pairwise)))
    truth = (share > 0.5) & (extent > 0)
    found = torch.as_tensor(least).to(inside.device)
    excess = cheapened.difference(truth.float(), found.float(), examples.batch.link_triangles)
    return excess / extent.sum()


def _doubles(values: Tensor) -> FloatArray:
    return values.detach().double().cpu().numpy()
