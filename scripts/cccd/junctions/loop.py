"""The training's loop: epochs, validation, and what comes out at the end; it survives a kill."""

from __future__ import annotations

import logging
import os
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

import numpy as np
import pandas as pd
import torch
from torch import nn
from torch_geometric.data import HeteroData
from torch_geometric.loader import DataLoader
from tqdm import tqdm

from cccd.containers import Frame
from cccd.errors import InputError
from cccd.junctions.checkpoint import Checkpoints, fingerprint, save_model, start_from
from cccd.junctions.data import EpochMaps, label_map
from cccd.junctions.decoding import closed_chains, fill_inside, label_inside
from cccd.junctions.frozen_graphs import read_maps
from cccd.junctions.loss import total_loss
from cccd.junctions.network import JunctionNetwork
from cccd.junctions.scoring import SliceScore, score_slice
from cccd.junctions.synthetic_maps import SyntheticMap
from cccd.settings.junctions import InferenceSettings, NetworkSettings
from cccd.store import atomic_path

__all__ = ["train_model", "validate"]

logger = logging.getLogger(__name__)

_FLAT = Frame(np.eye(4), 2, (1, 1, 1))


def train_model(
    graphs_path: str | Path,
    settings: NetworkSettings,
    seed: int,
    checkpoint_dir: str | Path,
    model_path: str | Path,
    history_path: str | Path,
    threads: int = 1,
) -> None:
    """Train the junction network; a killed run goes on after its last whole epoch.

    Parameters
    ----------
    graphs_path : path
        From `cccd.junctions.frozen_graphs.generate_graphs`.
    settings : NetworkSettings
    seed : int
    checkpoint_dir : path
        One checkpoint per epoch (model, optimiser, scheduler, random state); the last two are kept.
    model_path, history_path : path
        Best weights by validation correctness, and the table of epochs.
    threads : int
        One computes; the others draw maps.

    Notes
    -----
    The maps drawn do not depend on ``threads``.
    """
    started = time.perf_counter()
    torch.set_num_threads(1)
    cast(Any, torch).manual_seed(seed)
    frozen, validation = (read_maps(graphs_path, split) for split in ("training", "validation"))
    if not frozen or not validation:
        raise InputError("config gnn.graphs", "training or validation is empty", "draw at least one of each")
    prepared = [label_map(drawn, False, settings) for drawn in validation]
    run = _Run.start(settings, len(_loader(EpochMaps(frozen, settings, seed, 0), threads)))
    checkpoints = Checkpoints(Path(checkpoint_dir), fingerprint(graphs_path, settings, seed))
    state = checkpoints.newest()
    if state is not None:
        run.restore(state)
    for epoch in range(len(run.history), settings.epochs):
        if run.is_stuck(epoch, settings.patience):
            break
        begun = time.perf_counter()
        loss = _run_epoch(run, EpochMaps(frozen, settings, seed, epoch), threads)
        row = {"epoch": epoch, "loss": loss, **validate(run.model, validation, prepared, settings.inference)}
        seconds = round(time.perf_counter() - begun, 2)
        run.record({**row, "seconds": seconds, "device": run.device_name(threads)})
        checkpoints.save(epoch, run.state())
    save_model(model_path, run.model.sizes, run.best["weights"], seed)
    with atomic_path(history_path) as temporary:
        pd.DataFrame(run.history).to_csv(temporary, index=False)
    logger.info("best epoch %d; %.0f s in this process", run.best["epoch"], time.perf_counter() - started)


@dataclass
class _Run:
    """A training between two epochs."""

    model: JunctionNetwork
    optimiser: torch.optim.Optimizer
    schedule: torch.optim.lr_scheduler.LRScheduler
    history: list[dict[str, Any]] = field(default_factory=list[dict[str, Any]])
    best: dict[str, Any] = field(default_factory=lambda: {"score": -1.0, "epoch": -1, "weights": None})

    @classmethod
    def start(cls, settings: NetworkSettings, steps_per_epoch: int) -> _Run:
        """Build a network, perhaps on given weights, and what moves them."""
        model = JunctionNetwork(
            width=settings.width,
            link_width=settings.link_width,
            pixel_layers=settings.pixel_layers,
            message_layers=settings.message_layers,
            heads=settings.heads,
            dropout=settings.dropout,
        ).to("cuda" if torch.cuda.is_available() else "cpu")
        if settings.start:
            start_from(model, settings.start, settings.optimiser.new_messages)
        peak = settings.learning_rate
        optimiser = torch.optim.AdamW(
            model.parameters(), lr=peak, weight_decay=settings.optimiser.weight_decay
        )
        schedule = torch.optim.lr_scheduler.OneCycleLR(
            optimiser,
            peak,
            total_steps=settings.epochs * steps_per_epoch + 1,
            pct_start=settings.optimiser.rising,
            cycle_momentum=False,
        )
        return cls(model, optimiser, schedule)

    @property
    def device(self) -> torch.device:
        return next(self.model.parameters()).device

    def device_name(self, threads: int) -> str:
        on_gpu = self.device.type == "cuda"
        return torch.cuda.get_device_name(self.device) if on_gpu else f"CPU, {threads} threads"

    def is_stuck(self, epoch: int, patience: int) -> bool:
        """Whether the best epoch is too long ago."""
        stuck = self.best["epoch"] >= 0 and epoch - self.best["epoch"] > patience
        if stuck:
            logger.info("no better than epoch %d for %d epochs: done", self.best["epoch"], patience)
        return stuck

    def record(self, row: dict[str, Any]) -> None:
        """Keep an epoch's row, and its weights if they are the best so far."""
        logger.info("%s", row)
        self.history = [*self.history, row]
        # few slices are on the edge of correct; the mean with Dice tells epochs apart with less noise
        score = (row["validation_correct"] + row["validation_dice"]) / 2
        if score > self.best["score"]:
            weights = {name: value.detach().cpu().clone() for name, value in self.model.state_dict().items()}
            self.best = {"score": float(score), "epoch": row["epoch"], "weights": weights}

    def state(self) -> dict[str, Any]:
        """All that a later process needs to go on."""
        return {
            "model": self.model.state_dict(),
            "optimiser": self.optimiser.state_dict(),
            "schedule": self.schedule.state_dict(),
            "random": torch.get_rng_state(),
            "history": self.history,
            "best": self.best,
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go on from what `state` gave."""
        self.model.load_state_dict(state["model"])
        self.optimiser.load_state_dict(state["optimiser"])
        self.schedule.load_state_dict(state["schedule"])
        torch.set_rng_state(state["random"])
        self.history, self.best = state["history"], state["best"]


def _loader(maps: EpochMaps, threads: int) -> DataLoader[HeteroData]:
    """Batches of an epoch; a last one that is too small is left out."""
    workers = max(0, min(threads, os.cpu_count() or 1) - 1)
    size = min(maps.settings.batch_size, len(maps))
    return DataLoader(maps, batch_size=size, drop_last=True, num_workers=workers)


def _run_epoch(run: _Run, maps: EpochMaps, threads: int) -> float:
    """One pass over an epoch's maps; returns the mean loss."""
    run.model.train()
    loader = _loader(maps, threads)
    total = 0.0
    for batch in tqdm(loader, desc=f"epoch {maps.epoch}", unit="batch", mininterval=2):
        there = batch.to(run.device)
        loss = total_loss(run.model(there), there, maps.settings.loss)
        run.optimiser.zero_grad(set_to_none=True)
        torch.autograd.backward(loss)
        nn.utils.clip_grad_norm_(run.model.parameters(), maps.settings.optimiser.gradient_norm)
        run.optimiser.step()
        run.schedule.step()
        total += float(loss.detach())
    return total / len(loader)


def validate(
    model: JunctionNetwork,
    maps: Sequence[SyntheticMap],
    prepared: Sequence[HeteroData],
    settings: InferenceSettings,
) -> dict[str, float]:
    """Link precision, recall and F1, and the share of slices that the decoder gets right."""
    true_positive = positive = true = 0.0
    scores: list[SliceScore] = []
    for drawn, data in zip(maps, prepared, strict=True):
        (logits,) = model.predict([data])
        predicted, label = logits[1] > 0, data["link"].y.numpy() > 0.5
        true_positive += np.count_nonzero(predicted & label)
        positive += np.count_nonzero(predicted)
        true += np.count_nonzero(label)
        masks, origin = fill_inside(data.graph, label_inside(data.graph, logits, settings))
        curves = closed_chains(masks, origin, np.zeros(1, np.int64), _FLAT, settings)
        scores.append(score_slice(list(curves), drawn.contours))
    precision, recall = true_positive / max(positive, 1), true_positive / max(true, 1)
    return {
        "link_precision": float(precision),
        "link_recall": float(recall),
        "link_f1": float(2 * precision * recall / max(precision + recall, 1e-12)),
        "validation_correct": float(np.mean([score.correct for score in scores])),
        "validation_dice": float(np.mean([score.dice for score in scores])),
    }
