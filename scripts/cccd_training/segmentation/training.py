"""Training of a segmentation network: epochs, checkpoints, the held-out patients' scores."""

from __future__ import annotations

import hashlib
import json
import logging
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple, Protocol, cast

import numpy as np
import pandas as pd
import torch
from monai.losses.dice import DiceCELoss
from torch import Tensor, nn
from tqdm import tqdm

from cccd.geometry.raster import dice
from cccd_networks.devices import chosen_device
from cccd_segmentation.inference import labels_of, predict, probabilities
from cccd_segmentation.model import load_segmenter
from cccd_segmentation.networks import build, networks, parameters
from cccd_segmentation.plan import Plan
from cccd_segmentation.settings import SegmentationSettings
from cccd_training.checkpoints import Checkpoints
from cccd_training.run import Run
from cccd_training.segmentation.examples import (
    Example,
    LabelledScan,
    batches,
    make_plan,
    prepare,
    split_patients,
)
from cccd_training.segmentation.scores import volume_scores

logger = logging.getLogger(__name__)

#: Weight of each further output's loss beside the final one's (deep supervision).
_FURTHER = 0.5
#: Held-out scans scored after every epoch, for the learning curve; `score_held_out` scores all.
_WATCHED = 2
_WEIGHT_DECAY = 1e-2
_GRADIENT_NORM = 12.0  # nnU-Net's


class Supervised(Protocol):
    """What every network (`cccd_segmentation.networks`) has for its training."""

    def outputs(self, volume: Tensor, labels: Tensor) -> list[tuple[Tensor, Tensor]]:
        """Return pairs of logits and labels, the final ones first."""
        ...


class Trained(NamedTuple):
    """A trained network, its plan, and the table of its epochs."""

    model: nn.Module
    plan: Plan
    history: pd.DataFrame


def train_segmenter(
    scans: Sequence[LabelledScan],
    network: str,
    settings: SegmentationSettings,
    seed: int,
    checkpoint_dir: str | Path,
    organ: str = "",
    threads: int = 1,
) -> Trained:
    """Train one network; a killed run goes on after its last whole epoch to the same weights.

    Parameters
    ----------
    scans : sequence of LabelledScan
        Split by patients: ``settings.test_share`` of them score the network and train nothing.
    network : str
        Its name in `cccd_segmentation.networks.networks`.
    settings : SegmentationSettings
    seed : int
        Weights, split, order and variation of the scans are drawn from it.
    checkpoint_dir : path
        One checkpoint per epoch; the last two are kept.
    organ : str
        What the labels are, kept with the weights.
    threads : int

    Returns
    -------
    Trained
        With the last epoch's weights: no epoch is chosen by the held-out patients.

    Raises
    ------
    InputError
        Fewer than two patients, no such network, scans of several modalities.
    """
    torch.set_num_threads(threads)
    started = time.perf_counter()
    kind = networks()[network]
    chosen, held = split_patients(scans, settings.test_share, seed)
    sizes = {} if settings.width == kind.published_width else dict(kind.sizes)
    plan = make_plan(chosen, network, settings.width or kind.width, sizes, settings, organ, seed)
    torch.manual_seed(seed)
    model = build(network, plan.classes, plan.width, plan.sizes).to(chosen_device())
    logger.info("%s of %d weights, %d scans, %d held out", network, parameters(model), len(chosen), len(held))
    training, test = ([prepare(scan, plan) for scan in some] for some in (chosen, held[:_WATCHED]))
    steps = settings.epochs * -(-len(training) // settings.batch_size)
    run = Run.start(model, settings.learning_rate, steps, _WEIGHT_DECAY)
    checkpoints = Checkpoints(Path(checkpoint_dir), _fingerprint(plan, settings, training))
    state = checkpoints.newest()
    if state is not None:
        run.restore(state)
    for epoch in range(len(run.history), settings.epochs):
        begun = time.perf_counter()
        torch.manual_seed(seed + 1 + epoch)  # the same randomness whether the run was resumed or not
        loss = _run_epoch(run, training, plan, settings, epoch)
        scores = score(model, test, plan)
        seconds = round(time.perf_counter() - begun, 1)
        row = {"epoch": epoch, "loss": loss, **_named(scores, plan), "seconds": seconds}
        logger.info("%s", row)
        run.history = [*run.history, row]
        checkpoints.save(epoch, run.state())
    logger.info("%.0f s in this process", time.perf_counter() - started)
    return Trained(model.eval(), plan, pd.DataFrame(run.history))


def _fingerprint(plan: Plan, settings: SegmentationSettings, examples: Sequence[Example]) -> str:
    """Digest what a checkpoint must have in common with a run to be resumed by it."""
    digest = hashlib.sha256(json.dumps([plan.as_plain(), settings.as_config()], sort_keys=True).encode())
    for example in examples:
        digest.update(example.image.numpy().tobytes() + example.labels.numpy().tobytes())
    return digest.hexdigest()


def _run_epoch(
    run: Run, examples: Sequence[Example], plan: Plan, settings: SegmentationSettings, epoch: int
) -> float:
    """One pass over the training examples; returns the mean loss of the final output."""
    run.model.train()
    dice_ce = DiceCELoss(to_onehot_y=True, softmax=True, include_background=False, batch=True)
    device = run.device
    total = []
    for images, labels in tqdm(
        batches(examples, plan, settings, epoch, plan.seed), desc=f"epoch {epoch}", mininterval=5
    ):
        with torch.autocast(device.type, torch.bfloat16, enabled=settings.precision == "bfloat16"):
            outputs = cast(Supervised, run.model).outputs(images.to(device), labels.to(device))
        losses = [dice_ce(logits.float(), truth) for logits, truth in outputs]
        weights = [1.0] + [_FURTHER] * (len(losses) - 1)
        loss = (torch.stack(losses) * torch.tensor(weights, device=device)).sum() / sum(weights)
        if not run.step(loss, _GRADIENT_NORM):
            logger.warning("epoch %d: a step whose gradient is not finite was left out", epoch)
        total.append(float(losses[0].detach()))
    return float(np.mean(total))


def score(model: nn.Module, examples: Sequence[Example], plan: Plan) -> np.ndarray:
    """Dice (examples, labels) on the working grid."""
    model.eval()
    labels = range(1, plan.classes)
    found = [predict(model, example.image, plan).argmax(0).numpy() for example in examples]
    truth = [example.labels[0].numpy() for example in examples]
    return np.array([[dice(a == n, b == n) for n in labels] for a, b in zip(found, truth, strict=True)])


def score_held_out(
    path: str | Path, scans: Sequence[LabelledScan], settings: SegmentationSettings, seed: int
) -> pd.DataFrame:
    """Score the shipped file on the held-out patients, on the scans' own grids.

    Parameters
    ----------
    path : path
        Of `cccd_segmentation.model.save_segmenter`.
    scans, settings, seed
        As for `train_segmenter`, which make the same split.

    Returns
    -------
    DataFrame
        One row per patient and label: ``patient``, ``label``, ``dice``, ``assd_mm``, ``hd95_mm`` and
        ``seconds``.
    """
    model, plan = load_segmenter(path)
    rows: list[dict[str, Any]] = []
    for scan in split_patients(scans, settings.test_share, seed)[1]:
        begun = time.perf_counter()
        found = labels_of(probabilities(model, scan.image, plan), plan)
        seconds = time.perf_counter() - begun
        spacing = np.linalg.norm(scan.image.affine[:3, :3], axis=0)
        for number, label in enumerate(plan.labels, start=1):
            measured = volume_scores(found == label, scan.labels == number, spacing)
            rows.append({"patient": scan.patient, "label": label, **measured, "seconds": seconds})
    return pd.DataFrame(rows)


def _named(scores: np.ndarray, plan: Plan) -> dict[str, float]:
    """Mean Dice over the held-out patients, of each label and of all."""
    each = {f"dice_{value}": float(mean) for value, mean in zip(plan.labels, scores.mean(0), strict=True)}
    return {"dice": float(scores.mean()), **each} if len(plan.labels) > 1 else {"dice": float(scores.mean())}
