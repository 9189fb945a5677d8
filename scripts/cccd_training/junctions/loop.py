"""The training's loop: epochs, validation, and what comes out at the end; it survives a kill."""

from __future__ import annotations

import logging
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

import pandas as pd
import torch
from tqdm import tqdm

from cccd.errors import InputError
from cccd.store import atomic_path
from cccd_junctions.checkpoint import save_model
from cccd_networks.devices import chosen_device
from cccd_networks.settings import NetworkSettings
from cccd_training.checkpoints import Checkpoints
from cccd_training.junctions.frozen_graphs import SPLITS, read_maps
from cccd_training.junctions.start import fingerprint, start_from
from cccd_training.junctions.tasks import Task, make_task
from cccd_training.run import Run

logger = logging.getLogger(__name__)

# Decoupled weight decay (Loshchilov and Hutter 2019): small, as fresh maps leave little to be learnt by
# heart.
_WEIGHT_DECAY = 1e-4

# Largest norm of a step's gradient: single hard maps would throw the weights off.
_GRADIENT_NORM = 1.0


def train_model(
    graphs_path: str | Path,
    settings: NetworkSettings,
    seed: int,
    checkpoint_dir: str | Path,
    model_path: str | Path,
    history_path: str | Path,
    threads: int = 1,
) -> None:
    """Train the network that ``settings.network`` names; a killed run goes on after its last whole epoch.

    Parameters
    ----------
    graphs_path : path
        From `cccd_training.junctions.frozen_graphs.generate_graphs`.
    settings : NetworkSettings
    seed : int
    checkpoint_dir : path
        One checkpoint per epoch (model, optimiser, scheduler, random state); the last two are kept.
    model_path, history_path : path
        The weights of the last epoch whose validation is within a standard error of the best, and the table
        of epochs, in which the row of the weights' epoch has the scores of the test graphs as well.
    threads : int
        One computes; the others draw maps.

    Notes
    -----
    The maps drawn do not depend on ``threads``.
    """
    started = time.perf_counter()
    torch.set_num_threads(1)
    cast(Any, torch).manual_seed(seed)
    splits = {split: read_maps(graphs_path, split) for split in SPLITS}
    if not splits["training"] or not splits["validation"]:
        raise InputError("config gnn.graphs", "training or validation is empty", "draw at least one of each")
    task = make_task(splits["training"], settings, seed)
    plan = task.plan
    run = _started(task, threads)
    checkpoints = Checkpoints(Path(checkpoint_dir), fingerprint(graphs_path, settings, seed))
    state = checkpoints.newest()
    if state is not None:
        run.restore(state)
    for epoch in range(len(run.history), plan.epochs):
        if run.is_stuck(epoch, plan.patience):
            break
        begun = time.perf_counter()
        loss = _run_epoch(run, task, epoch, threads)
        scores = task.score(run.model, splits["validation"])
        row = {"epoch": epoch, "loss": loss, **_named("validation", scores)}
        seconds = round(time.perf_counter() - begun, 2)
        row |= {"seconds": seconds, "device": run.device_name(threads)}
        run.record(row, len(splits["validation"]))
        checkpoints.save(epoch, run.state())
    run.model.load_state_dict(run.best["weights"])
    save_model(model_path, settings.network, run.model.sizes, run.best["weights"], seed)
    history = pd.DataFrame(run.history)
    if splits["test"]:
        for name, value in _named("test", task.score(run.model, splits["test"])).items():
            history.loc[history["epoch"] == run.best["epoch"], name] = value
    with atomic_path(history_path) as temporary:
        history.to_csv(temporary, index=False)
    logger.info("best epoch %d; %.0f s in this process", run.best["epoch"], time.perf_counter() - started)


def train_task(task: Task, seed: int, threads: int = 1) -> Any:
    """Train a task's network for all of its epochs and return it: no validation, no checkpoints."""
    torch.set_num_threads(1)
    cast(Any, torch).manual_seed(seed)
    run = _started(task, threads)
    for epoch in range(task.plan.epochs):
        logger.info("epoch %d: loss %.4f", epoch, _run_epoch(run, task, epoch, threads))
    return run.model


def _score(row: Mapping[str, Any]) -> float:
    """Mean of correct and Dice: few slices are on the edge of correct; Dice has less noise."""
    return float(row["validation_correct"] + row["validation_dice"]) / 2


def _named(split: str, scores: Mapping[str, float]) -> dict[str, float]:
    """Scores by the names of the history's columns."""
    of_links = {"validation": ""}.get(split, f"{split}_")
    return {
        (of_links if name.startswith("link") else f"{split}_") + name: value for name, value in scores.items()
    }


@dataclass
class _Run(Run):
    """A training of which the best epoch's weights are kept."""

    best: dict[str, Any] = field(default_factory=lambda: {"epoch": -1, "weights": None})

    def device_name(self, threads: int) -> str:
        on_gpu = self.device.type == "cuda"
        return torch.cuda.get_device_name(self.device) if on_gpu else f"CPU, {threads} threads"

    def is_stuck(self, epoch: int, patience: int) -> bool:
        """Whether the best epoch is too long ago."""
        best = max(self.history, key=_score)["epoch"] if self.history else epoch
        stuck = epoch - best > patience
        if stuck:
            logger.info("no better than epoch %d for %d epochs: done", best, patience)
        return stuck

    def record(self, row: dict[str, Any], graphs: int) -> None:
        """Keep an epoch's row, and its weights where so many validation graphs find none surely better.

        Of epochs within a standard error of the best the last is taken: its learning rate is the lowest.
        """
        logger.info("%s", row)
        self.history = [*self.history, row]
        best = max(self.history, key=_score)
        share = (best["validation_correct"] * graphs + 1) / (graphs + 2)  # not 0 or 1 for certain
        if _score(row) >= _score(best) - (share * (1 - share) / graphs) ** 0.5 / 2:
            weights = {name: value.detach().cpu().clone() for name, value in self.model.state_dict().items()}
            self.best = {"epoch": row["epoch"], "weights": weights}

    def state(self) -> dict[str, Any]:
        """All that a later process needs to go on."""
        return {**super().state(), "random": torch.get_rng_state(), "best": self.best}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go on from what `state` gave."""
        super().restore(state)
        torch.set_rng_state(state["random"])
        self.best = state["best"]


def _started(task: Task, threads: int) -> _Run:
    """Build a task's network, perhaps on given weights, and what moves them."""
    model = task.network().to(chosen_device())
    if task.settings.start:
        start_from(model, task.settings.start)
    steps = task.plan.epochs * len(task.loader(0, threads))
    return _Run.start(model, task.plan.learning_rate, steps, _WEIGHT_DECAY)


def _run_epoch(run: _Run, task: Task, epoch: int, threads: int) -> float:
    """One pass over an epoch's batches; returns the mean loss."""
    run.model.train()
    loader = task.loader(epoch, threads)
    total = 0.0
    for batch in tqdm(loader, desc=f"epoch {epoch}", unit="batch", mininterval=2):
        loss = task.loss(run.model, batch.to(run.device))
        run.step(loss, _GRADIENT_NORM)
        total += float(loss.detach())
    return total / len(loader)
