"""What training reads: graphs with labels and weights, in batches that a seed determines."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor
from torch.utils.data import Dataset

from cccd.geometry.arrays import AnyArray, IntArray
from cccd.junctions.batch import GraphBatch, make_batch
from cccd.junctions.delaunay import DelaunayGraph, join_graphs
from cccd.junctions.energy import EnergyWeights, energy_weights
from cccd.junctions.labels import inside_shares, link_labels
from cccd.junctions.observation import observe
from cccd.junctions.synthetic_maps import ALL_KINDS, RandomStream, SyntheticMap, draw_map
from cccd.settings.junctions import LossSettings, NetworkSettings

__all__ = ["EpochBatches", "Examples", "label_maps"]


@dataclass(frozen=True, eq=False)
class Examples:
    """A batch with its labels and weights; every slice weighs the same.

    Attributes
    ----------
    graph : DelaunayGraph
    batch : GraphBatch
    inside : (T,)
        Share of the triangle's area inside.
    inside_weight : (T,)
        Of a triangle's cross entropy.
    true : (L,)
        1 for links of the best border, else 0.
    true_weight : (L,)
        Of a link's cross entropy.
    energy_weights : EnergyWeights
        Of the triangles' and links' logits in the energy.
    """

    graph: DelaunayGraph
    batch: GraphBatch
    inside: Tensor
    inside_weight: Tensor
    true: Tensor
    true_weight: Tensor
    energy_weights: EnergyWeights[Tensor]

    def to(self, device: torch.device | str) -> Examples:
        """Move all tensors; the graph stays."""
        weights = self.energy_weights
        return Examples(
            self.graph,
            self.batch.to(device),
            self.inside.to(device),
            self.inside_weight.to(device),
            self.true.to(device),
            self.true_weight.to(device),
            EnergyWeights(weights.unary.to(device), weights.pairwise.to(device)),
        )


def label_maps(
    maps: Sequence[SyntheticMap], hide_image: Sequence[bool] | AnyArray, settings: NetworkSettings
) -> Examples:
    """Observe maps, with or without their images, and label their graphs, joined to one batch."""
    slices = [
        observe(drawn.pixels, None if hidden else drawn.image, settings.inference)
        for drawn, hidden in zip(maps, hide_image, strict=True)
    ]
    inside = np.concatenate(
        [inside_shares(seen.graph, drawn.contours) for seen, drawn in zip(slices, maps, strict=True)]
    )
    graph = join_graphs([seen.graph for seen in slices])
    link_counts = np.diff(graph.link_offsets)
    weights = energy_weights(graph, settings.inference)
    return Examples(
        graph,
        make_batch(graph, [seen.intensity for seen in slices]),
        _real(inside),
        _real(np.concatenate([_triangle_weights(seen.graph, settings.loss) for seen in slices]) / len(maps)),
        _real(link_labels(graph, inside)),
        _real(np.repeat(1 / link_counts, link_counts) / len(maps)),
        EnergyWeights(_real(weights.unary), _real(weights.pairwise)),
    )


def _triangle_weights(graph: DelaunayGraph, settings: LossSettings) -> AnyArray:
    """Weights (T,) that follow a triangle's extent, as in the energy; what touches a ghost point is known."""
    extent = np.clip(np.sqrt(graph.areas), settings.least_extent_px, settings.largest_extent_px)
    weight = np.where(graph.outer, 0, extent)
    return weight / weight.sum()


def _real(array: AnyArray) -> Tensor:
    return torch.as_tensor(np.asarray(array, np.float32))


class EpochBatches(Dataset[Examples]):
    """Batches of one epoch: the frozen maps in a new order, among fresh ones drawn from the seed.

    Parameters
    ----------
    frozen : sequence of SyntheticMap
    settings : NetworkSettings
    seed, epoch : int
    """

    def __init__(self, frozen: Sequence[SyntheticMap], settings: NetworkSettings, seed: int, epoch: int):
        self.frozen, self.settings, self.seed, self.epoch = frozen, settings, seed, epoch
        order = np.random.default_rng([seed, RandomStream.MAP_ORDER, epoch])
        total = len(frozen) + settings.fresh_maps
        size = settings.batch_size
        shuffled = order.permutation(total)
        self.batches = [shuffled[n : n + size] for n in range(0, total - size + 1, size)] or [shuffled]
        weights = np.array([getattr(settings.kind_weights, kind) for kind in ALL_KINDS])
        self.kinds: IntArray = order.choice(len(ALL_KINDS), total, p=weights / weights.sum())

    def __len__(self) -> int:
        return len(self.batches)

    def __getitem__(self, index: int) -> Examples:
        maps = [self._map(int(number)) for number in self.batches[index]]
        hiding = np.random.default_rng([self.seed, RandomStream.HIDDEN_IMAGES, self.epoch, index])
        return label_maps(maps, hiding.random(len(maps)) < self.settings.hidden_images, self.settings)

    def _map(self, number: int) -> SyntheticMap:
        if number < len(self.frozen):
            return self.frozen[number]
        rng = np.random.default_rng([self.seed, RandomStream.FRESH_MAPS, self.epoch, number])
        return draw_map(rng, ALL_KINDS[int(self.kinds[number])])
