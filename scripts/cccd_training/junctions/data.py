"""What training reads: slices with labels and weights, in an order that a seed determines."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from torch.utils.data import Dataset
from torch_geometric.data import HeteroData

from cccd.geometry.arrays import AnyArray, IntArray
from cccd_junctions.delaunay import DelaunayGraph
from cccd_junctions.energy import energy_weights
from cccd_junctions.graph_data import make_data, real_tensor
from cccd_junctions.observation import observe
from cccd_training.junctions.labels import inside_shares, link_labels
from cccd_training.junctions.synthetic_maps import (
    ALL_KINDS,
    KIND_WEIGHTS,
    RandomStream,
    SyntheticMap,
    draw_map,
)

# Labelled maps that are kept, about 1 MB each.
_MOST_KEPT = 400

# Share of maps whose image is hidden, so that the network does without one as well.
_HIDDEN_IMAGES = 0.3

# Root of a triangle's area that its cross entropy counts by: at least that of half a pixel, the triangle
# between three neighbours; at most this, or else the middle of an organ outweighs its border.
_EXTENT_PX = (0.7, 12.0)


def label_map(drawn: SyntheticMap, hide_image: bool) -> HeteroData:
    """Observe a map, with or without its image, and label its graph.

    Returns
    -------
    HeteroData
        From `cccd_junctions.graph_data.make_data`, and besides: ``graph``, the `DelaunayGraph`; of
        triangles and links their labels ``y`` (the share of a triangle's area inside; 1 for links of the
        best border, else 0), the ``weight`` of their cross entropies, which sums to 1 over the slice, and
        the ``energy_weight`` of their logits.
    """
    seen = observe(drawn.pixels, None if hide_image else drawn.image)
    graph = seen.graph
    inside = inside_shares(graph, drawn.contours)
    weights = energy_weights(graph)
    data = make_data(graph, seen.intensity)
    data.graph = graph
    data["triangle"].y = real_tensor(inside)
    data["triangle"].weight = real_tensor(_triangle_weights(graph))
    data["triangle"].energy_weight = real_tensor(weights.unary)
    data["link"].y = real_tensor(link_labels(graph, inside))
    data["link"].weight = torch.full((len(graph.links),), 1 / len(graph.links))
    data["link"].energy_weight = real_tensor(weights.pairwise)
    return data


def _triangle_weights(graph: DelaunayGraph) -> AnyArray:
    """Weights (T,) that follow a triangle's extent, as in the energy; what touches a ghost point is known."""
    extent = np.clip(np.sqrt(graph.areas), *_EXTENT_PX)
    weight = np.where(graph.outer, 0, extent)
    return weight / weight.sum()


class FrozenMaps:
    """Maps that every epoch reads again: labelled when first read, then kept.

    Parameters
    ----------
    maps : sequence of SyntheticMap
    """

    def __init__(self, maps: Sequence[SyntheticMap]):
        self.maps = maps
        self._kept: dict[tuple[int, bool], HeteroData] = {}

    def __len__(self) -> int:
        return len(self.maps)

    def labelled(self, number: int, hide_image: bool) -> HeteroData:
        """Label a map, as by `label_map`."""
        key = number, hide_image
        data = self._kept.get(key)
        if data is None:
            data = label_map(self.maps[number], hide_image)
            if len(self._kept) < _MOST_KEPT:
                self._kept[key] = data
        return data


class EpochMaps(Dataset[HeteroData]):
    """Labelled maps of one epoch: the frozen ones in a new order, among fresh ones drawn from the seed.

    Parameters
    ----------
    frozen : FrozenMaps
    fresh : int
        How many of these.
    seed, epoch : int
    """

    def __init__(self, frozen: FrozenMaps, fresh: int, seed: int, epoch: int):
        self.frozen, self.seed, self.epoch = frozen, seed, epoch
        random = np.random.default_rng([seed, RandomStream.MAP_ORDER, epoch])
        count = len(frozen) + fresh
        self.order: IntArray = random.permutation(count)
        weights = np.array([KIND_WEIGHTS[kind] for kind in ALL_KINDS])
        self.kinds: IntArray = random.choice(len(ALL_KINDS), count, p=weights / weights.sum())

    def __len__(self) -> int:
        return len(self.order)

    def __getitem__(self, index: int) -> HeteroData:
        number = int(self.order[index])
        hiding = np.random.default_rng([self.seed, RandomStream.HIDDEN_IMAGES, self.epoch, number])
        hidden = bool(hiding.random() < _HIDDEN_IMAGES)
        if number < len(self.frozen):
            return self.frozen.labelled(number, hidden)
        rng = np.random.default_rng([self.seed, RandomStream.FRESH_MAPS, self.epoch, number])
        drawn = draw_map(rng, ALL_KINDS[int(self.kinds[number])])
        return label_map(drawn, hidden)
