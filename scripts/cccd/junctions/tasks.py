"""What is trained: the two networks, each with its batches, its loss and its scores."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
import torch
from torch import Tensor
from torch.utils.data import Dataset
from torch_geometric.data import Data, HeteroData
from torch_geometric.loader import DataLoader

from cccd.containers import Frame
from cccd.geometry.arrays import BoolArray, IntArray
from cccd.junctions.data import EpochMaps, FrozenMaps, label_map
from cccd.junctions.decoding import closed_chains, fill_loops
from cccd.junctions.grid import build_grid, find_chains
from cccd.junctions.labelling import label_slice
from cccd.junctions.labels import grid_labels
from cccd.junctions.loss import total_loss
from cccd.junctions.network import JunctionNetwork
from cccd.junctions.paper_network import PaperNetwork, grid_data
from cccd.junctions.scoring import SliceScore, score_labels, score_slice
from cccd.junctions.synthetic_maps import RandomStream, SyntheticMap
from cccd.settings.junctions import NetworkSettings

__all__ = ["OurTask", "PaperTask", "Task", "make_task"]

_FLAT = Frame(np.eye(4), 2, (1, 1, 1))


class Task(Protocol):
    """A network and how it is trained on maps."""

    settings: NetworkSettings

    def network(self) -> JunctionNetwork | PaperNetwork:
        """Build the network."""
        ...

    def loader(self, epoch: int, threads: int) -> DataLoader[Any]:
        """Batches of an epoch."""
        ...

    def loss(self, model: Any, batch: Any) -> Tensor:
        """Value to be minimised."""
        ...

    def score(self, model: Any, maps: Sequence[SyntheticMap]) -> dict[str, float]:
        """``link_precision``, ``link_recall``, ``link_f1``, and shares ``correct`` and mean ``dice``."""
        ...


def _loader(maps: Dataset[Any], count: int, batch_size: int, threads: int) -> DataLoader[Any]:
    """Batches of an epoch; a last one that is too small is left out."""
    workers = max(0, min(threads, os.cpu_count() or 1) - 1)
    return DataLoader(maps, batch_size=min(batch_size, count), drop_last=True, num_workers=workers)


def _scores(
    predicted: Sequence[BoolArray], labels: Sequence[BoolArray], slices: Sequence[SliceScore]
) -> dict[str, float]:
    found, true = np.concatenate(predicted), np.concatenate(labels)
    hits = np.count_nonzero(found & true)
    precision, recall = hits / max(np.count_nonzero(found), 1), hits / max(np.count_nonzero(true), 1)
    return {
        "link_precision": float(precision),
        "link_recall": float(recall),
        "link_f1": float(2 * precision * recall / max(precision + recall, 1e-12)),
        "correct": float(np.mean([score.correct for score in slices])),
        "dice": float(np.mean([score.dice for score in slices])),
    }


class OurTask:
    """Our network: triangles and links of the Delaunay graph, trained through the cut."""

    def __init__(self, frozen: Sequence[SyntheticMap], settings: NetworkSettings, seed: int):
        self.frozen, self.settings, self.seed = FrozenMaps(frozen, settings), settings, seed

    def network(self) -> JunctionNetwork:
        """Build the network."""
        settings = self.settings
        return JunctionNetwork(
            width=settings.width,
            link_width=settings.link_width,
            pixel_layers=settings.pixel_layers,
            message_layers=settings.message_layers,
            heads=settings.heads,
            dropout=settings.dropout,
        )

    def loader(self, epoch: int, threads: int) -> DataLoader[HeteroData]:
        """Batches of the frozen maps among fresh ones."""
        maps = EpochMaps(self.frozen, self.settings, self.seed, epoch)
        return _loader(maps, len(maps), self.settings.batch_size, threads)

    def loss(self, model: JunctionNetwork, batch: HeteroData) -> Tensor:
        """Cross entropies and the loss of the cut."""
        return total_loss(model(batch), batch, self.settings.loss)

    def score(self, model: JunctionNetwork, maps: Sequence[SyntheticMap]) -> dict[str, float]:
        """Score links, and the curves that the cut gives."""
        settings = self.settings.inference
        predicted: list[BoolArray] = []
        labels: list[BoolArray] = []
        scores: list[SliceScore] = []
        for begin in range(0, len(maps), settings.slices_per_batch):
            batch = maps[begin : begin + settings.slices_per_batch]
            slices = [label_map(drawn, False, self.settings) for drawn in batch]
            for drawn, data, logits in zip(batch, slices, model.predict(slices), strict=True):
                predicted.append(logits[1] > 0)
                labels.append(data["link"].y.numpy() > 0.5)
                inside = label_slice(data.graph, logits, settings).inside
                scores.append(score_labels(data.graph, inside, drawn.contours, settings))
        return _scores(predicted, labels, scores)


class _Grids(Dataset[Data]):
    """Labelled grids, in an order drawn from the seed and the epoch."""

    def __init__(self, grids: Sequence[Data], order: IntArray):
        self.grids, self.order = grids, order

    def __len__(self) -> int:
        return len(self.order)

    def __getitem__(self, index: int) -> Data:
        return self.grids[int(self.order[index])]


class PaperTask:
    """The paper's network: links of the pixel grid, labels +1 and -1, the frozen graphs alone."""

    def __init__(self, frozen: Sequence[SyntheticMap], settings: NetworkSettings, seed: int):
        self.settings, self.seed = settings, seed
        self.grids = [self._labelled(drawn) for drawn in frozen]

    @staticmethod
    def _labelled(drawn: SyntheticMap) -> Data:
        grid = build_grid(drawn.pixels)
        data = grid_data(grid)
        data.edge_label = torch.as_tensor(grid_labels(grid, drawn.contours), dtype=torch.float32)
        return data

    def network(self) -> PaperNetwork:
        """Build the network."""
        paper = self.settings.paper
        return PaperNetwork(paper.width, paper.layers, paper.dropout)

    def loader(self, epoch: int, threads: int) -> DataLoader[Data]:
        """Batches of the frozen graphs."""
        order = np.random.default_rng([self.seed, RandomStream.MAP_ORDER, epoch]).permutation(len(self.grids))
        return _loader(_Grids(self.grids, order), len(order), self.settings.paper.batch_size, 1)

    def loss(self, model: PaperNetwork, batch: Data) -> Tensor:
        """Mean squared error to labels +1 and -1: the quadratic cost of Scarselli et al. (2009)."""
        return (model(batch) - batch.edge_label).square().mean()

    def score(self, model: PaperNetwork, maps: Sequence[SyntheticMap]) -> dict[str, float]:
        """Score links, and the chains that are left."""
        grids = [build_grid(drawn.pixels) for drawn in maps]
        values = model.link_scores(grids)
        labels = [grid_labels(grid, drawn.contours) > 0 for grid, drawn in zip(grids, maps, strict=True)]
        scores: list[SliceScore] = []
        for grid, value, drawn in zip(grids, values, maps, strict=True):
            loops = find_chains(grid, value if grid.has_junctions else None)
            origin = grid.pixels.min(axis=0) - 1
            masks = fill_loops([loops], origin, grid.pixels.max(axis=0) + 2 - origin)
            curves = closed_chains(masks, origin, np.zeros(1, np.int64), _FLAT, self.settings.inference)
            scores.append(score_slice(list(curves), drawn.contours))
        return _scores([value > 0 for value in values], labels, scores)


def make_task(frozen: Sequence[SyntheticMap], settings: NetworkSettings, seed: int) -> Task:
    """Choose by ``settings.network``; the frozen maps are those trained on."""
    return (PaperTask if settings.network == "paper" else OurTask)(frozen, settings, seed)
