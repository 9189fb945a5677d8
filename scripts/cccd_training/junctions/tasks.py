"""What is trained: a network with its batches, its loss and its scores."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from torch import Tensor
from torch.utils.data import Dataset
from torch_geometric.data import HeteroData
from torch_geometric.loader import DataLoader

from cccd.geometry.arrays import BoolArray
from cccd.plugins import find, table
from cccd_junctions.inference import SLICES_PER_BATCH
from cccd_junctions.labelling import label_slice
from cccd_junctions.network import JunctionNetwork
from cccd_networks.settings import NetworkSettings
from cccd_training.junctions.data import EpochMaps, FrozenMaps, label_map
from cccd_training.junctions.loss import total_loss
from cccd_training.junctions.scoring import SliceScore, score_labels
from cccd_training.junctions.synthetic_maps import SyntheticMap


@dataclass(frozen=True)
class Plan:
    """How long a network is trained, and how fast.

    Attributes
    ----------
    epochs : int
        At most.
    patience : int
        Epochs without a better validation before training stops.
    learning_rate : float
        At its peak.
    """

    epochs: int
    patience: int
    learning_rate: float


class Task(Protocol):
    """A network and how it is trained on maps."""

    settings: NetworkSettings

    @property
    def plan(self) -> Plan:
        """What says how long it is trained."""
        ...

    def network(self) -> Any:
        """Build the network, a module that has its ``sizes``."""
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


def make_loader(maps: Dataset[Any], count: int, batch_size: int, threads: int) -> DataLoader[Any]:
    """Batches of an epoch; a last one that is too small is left out."""
    workers = max(0, min(threads, os.cpu_count() or 1) - 1)
    return DataLoader(maps, batch_size=min(batch_size, count), drop_last=True, num_workers=workers)


def link_and_curve_scores(
    predicted: Sequence[BoolArray], labels: Sequence[BoolArray], slices: Sequence[SliceScore]
) -> dict[str, float]:
    """Score links, and count the slices that are right."""
    return link_scores(predicted, labels) | {
        "correct": float(np.mean([score.correct for score in slices])),
        "dice": float(np.mean([score.dice for score in slices])),
    }


def link_scores(predicted: Sequence[BoolArray], labels: Sequence[BoolArray]) -> dict[str, float]:
    """Precision, recall and F1 of all links together."""
    found, true = np.concatenate(predicted), np.concatenate(labels)
    hits = np.count_nonzero(found & true)
    precision, recall = hits / max(np.count_nonzero(found), 1), hits / max(np.count_nonzero(true), 1)
    return {
        "link_precision": float(precision),
        "link_recall": float(recall),
        "link_f1": float(2 * precision * recall / max(precision + recall, 1e-12)),
    }


class OurTask:
    """Our network: triangles and links of the Delaunay graph, trained through the cut."""

    def __init__(self, frozen: Sequence[SyntheticMap], settings: NetworkSettings, seed: int):
        self.frozen, self.settings, self.seed = FrozenMaps(frozen), settings, seed

    @property
    def plan(self) -> Plan:
        """Section ``gnn`` of the configuration."""
        return Plan(self.settings.epochs, self.settings.patience, self.settings.learning_rate)

    def network(self) -> JunctionNetwork:
        """Build the network."""
        return JunctionNetwork(**self.settings.sizes)

    def loader(self, epoch: int, threads: int) -> DataLoader[HeteroData]:
        """Batches of the frozen maps among fresh ones."""
        maps = EpochMaps(self.frozen, self.settings.fresh_maps, self.seed, epoch)
        return make_loader(maps, len(maps), self.settings.batch_size, threads)

    def loss(self, model: JunctionNetwork, batch: HeteroData) -> Tensor:
        """Cross entropies and the loss of the cut."""
        return total_loss(model(batch), batch)

    def score(self, model: JunctionNetwork, maps: Sequence[SyntheticMap]) -> dict[str, float]:
        """Score links, and the curves that the cut gives."""
        predicted: list[BoolArray] = []
        labels: list[BoolArray] = []
        scores: list[SliceScore] = []
        for begin in range(0, len(maps), SLICES_PER_BATCH):
            batch = maps[begin : begin + SLICES_PER_BATCH]
            slices = [label_map(drawn, False) for drawn in batch]
            for drawn, data, logits in zip(batch, slices, model.predict(slices), strict=True):
                predicted.append(logits[1] > 0)
                labels.append(data["link"].y.numpy() > 0.5)
                inside = label_slice(data.graph, logits).inside
                scores.append(score_labels(data.graph, inside, drawn.contours))
        return link_and_curve_scores(predicted, labels, scores)


def make_task(frozen: Sequence[SyntheticMap], settings: NetworkSettings, seed: int) -> Task:
    """Choose by ``settings.network``; the frozen maps are those trained on."""
    others = table("JUNCTION_TRAINING")
    task = OurTask if settings.network == "ours" else find(others[settings.network])
    return task(frozen, settings, seed)
