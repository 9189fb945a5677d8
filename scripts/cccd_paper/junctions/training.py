"""How the paper's network is trained: the pixel grids of the frozen graphs, and labels of their links."""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import numpy as np
import torch
from torch import Tensor
from torch.utils.data import Dataset, Subset
from torch_geometric.data import Data
from torch_geometric.loader import DataLoader

from cccd.geometry.arrays import AnyArray, IntArray
from cccd_junctions.decoding import fill_loops
from cccd_junctions.delaunay import build_graph
from cccd_networks.settings import NetworkSettings
from cccd_paper.junctions.grid import GridGraph, build_grid, find_chains
from cccd_paper.junctions.network import PaperNetwork, grid_data
from cccd_training.junctions.labels import inside_shares, link_labels
from cccd_training.junctions.scoring import SliceScore, chains_around, score_slice
from cccd_training.junctions.synthetic_maps import RandomStream, SyntheticMap
from cccd_training.junctions.tasks import Plan, link_and_curve_scores, make_loader

# Not in the paper: graphs per step, 20 steps an epoch.
_BATCH_SIZE = 10
# The peak of one cycle of AdamW: the best of a sweep (docs/measured/paper_network.csv).
_LEARNING_RATE = 0.001


def grid_labels(grid: GridGraph, contours: Sequence[AnyArray]) -> IntArray:
    """Label every candidate (C,) of a pixel grid: +1 on the best border, -1 elsewhere (section 4.2).

    The best border is the Delaunay graph's (`link_labels`), as far as it runs between 8-neighbours.
    """
    graph = build_graph(grid.pixels[grid.observed])
    true = graph.links[link_labels(graph, inside_shares(graph, contours))].astype(np.int64)
    keys = [np.minimum(*ends.T) * len(graph.points) + np.maximum(*ends.T) for ends in (grid.candidates, true)]
    return np.where(np.isin(*keys), 1, -1)


class LinkTask:
    """Links with labels +1 and -1, predicted on the same graphs in every epoch.

    Attributes
    ----------
    graphs : list of Data
        With ``edge_label``.
    channels : int
    dropout : float
    learning_rate : float
        At its peak. A sweep changes all of these.
    """

    def __init__(self, graphs: Sequence[Data], settings: NetworkSettings, seed: int):
        self.graphs, self.settings, self.seed = graphs, settings, seed
        self.channels, self.learning_rate = settings.paper.sizes["channels"], _LEARNING_RATE
        self.dropout = 0.5  # the paper's number

    @property
    def plan(self) -> Plan:
        """All epochs that section ``gnn.paper`` of the configuration says."""
        epochs = self.settings.paper.epochs
        return Plan(epochs, epochs, self.learning_rate)

    def network(self) -> PaperNetwork:
        """Build the network."""
        features = self.graphs[0].num_node_features if len(self.graphs) else 1
        return PaperNetwork(self.channels, self.dropout, features)

    def loader(self, epoch: int, threads: int) -> DataLoader[Data]:
        """Batches of the graphs."""
        order = np.random.default_rng([self.seed, RandomStream.MAP_ORDER, epoch]).permutation(
            len(self.graphs)
        )
        graphs = Subset(cast("Dataset[Data]", self.graphs), order.tolist())
        return make_loader(graphs, len(order), _BATCH_SIZE, 1)

    def loss(self, model: PaperNetwork, batch: Data) -> Tensor:
        """Mean squared error to labels +1 and -1: the quadratic cost of Scarselli et al. (2009)."""
        return (model(batch) - batch.edge_label).square().mean()


class PaperTask(LinkTask):
    """Links of the pixel grids of the frozen graphs."""

    def __init__(self, frozen: Sequence[SyntheticMap], settings: NetworkSettings, seed: int):
        super().__init__([self._labelled(drawn) for drawn in frozen], settings, seed)

    @staticmethod
    def _labelled(drawn: SyntheticMap) -> Data:
        grid = build_grid(drawn.pixels)
        data = grid_data(grid)
        data.edge_label = torch.as_tensor(grid_labels(grid, drawn.contours), dtype=torch.float32)
        return data

    def score(self, model: PaperNetwork, maps: Sequence[SyntheticMap]) -> dict[str, float]:
        """Score links, and the chains that are left."""
        grids = [build_grid(drawn.pixels) for drawn in maps]
        values = model.link_scores(grids)
        labels = [grid_labels(grid, drawn.contours) > 0 for grid, drawn in zip(grids, maps, strict=True)]
        scores: list[SliceScore] = []
        for grid, value, drawn in zip(grids, values, maps, strict=True):
            loops = find_chains(grid, value if grid.has_junctions else None)
            origin = grid.pixels.min(axis=0) - 1
            (mask,) = fill_loops([loops], origin, grid.pixels.max(axis=0) + 2 - origin)
            scores.append(score_slice(chains_around(mask, origin), drawn.contours))
        return link_and_curve_scores([value > 0 for value in values], labels, scores)
