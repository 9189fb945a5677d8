"""Frozen graphs, streamed fresh ones, and training that survives a kill."""

from __future__ import annotations

import hashlib
import io
import json
import logging
import os
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import torch
from torch import Tensor, nn
from torch.utils.data import DataLoader, Dataset
from tqdm import tqdm

from cccd.containers import Frame
from cccd.errors import InputError
from cccd.geometry.arrays import concatenate_ragged
from cccd.junctions.complexes import Complex, build_complex, join_complexes
from cccd.junctions.cut import minimum_cut
from cccd.junctions.decoding import fill_inside
from cccd.junctions.features import measure
from cccd.junctions.inference import AREA_POWER, BORDER_COST, curves_from_masks, label_inside
from cccd.junctions.network import Batch, JunctionNetwork, make_batch
from cccd.junctions.reading import read_map
from cccd.junctions.samples import ALL_KINDS, Sample, draw_sample, inside_shares, link_labels
from cccd.junctions.scoring import score_slice
from cccd.store import atomic_path, read_graphs, write_graphs

__all__ = ["generate_graphs", "load_model", "read_samples", "train_model"]

logger = logging.getLogger(__name__)

#: How often each kind is drawn for training; the ones that are hard count more.
KIND_WEIGHTS = {
    "clean": 1, "spurs": 1, "bridges": 2, "pinch": 1, "blocks": 1, "gaps": 3, "noise": 2, "double": 3,
    "thick": 4, "mixed": 8, "everything": 2, "canny": 9, "canny_whole": 0.5,
}  # fmt: skip

# Random streams that must not overlap: frozen splits, fresh maps, order of the maps, what is hidden, and
# the maps of the paper's size.
_FROZEN, _FRESH, _ORDER, _HIDING, _PAPER = 1, 2, 3, 4, 5
SPLITS = ("training", "validation", "test")

# Nats by which the true cut should win, and what its loss weighs beside the cross entropies.
_MARGIN = 2.0
_CUT_WEIGHT = 4.0

# Share of training maps whose grey slice is hidden from the network, so that it does without as well.
_HIDDEN_GREY = 0.3


#: Graphs and nodes of each that took 6.4 GB as dense matrices (sections 4.3 and 8).
PAPER_GRAPHS, PAPER_NODES = 209, 1917
# How many of that size are drawn to tell what they take.
_PAPER_SHOWN = 4


# Graphs -----------------------------------------------------------------------------------------------


def _kinds(count: int) -> list[str]:
    """List kinds in the proportions of `KIND_WEIGHTS`, the same for every split."""
    weights = np.array([KIND_WEIGHTS[kind] for kind in ALL_KINDS], float)
    places = (np.arange(count) + 0.5) / max(count, 1) * weights.sum()
    return [ALL_KINDS[n] for n in np.searchsorted(np.cumsum(weights), places)]


def _quantised(image: np.ndarray) -> np.ndarray:
    low, high = float(image.min()), float(image.max())
    return np.rint((image - low) * (255 / max(high - low, 1e-9))).astype(np.uint8)


def _pack(samples: Sequence[Sample]) -> dict[str, np.ndarray]:
    """Ragged columns of a split: pixels, true contours, links with labels, triangles' shares, images."""
    graphs = [build_complex(sample.pixels) for sample in samples]
    shares = [inside_shares(graph, sample.contours) for graph, sample in zip(graphs, samples, strict=True)]
    labels = [np.where(link_labels(g, y), 1, -1) for g, y in zip(graphs, shares, strict=True)]
    pixels, pixel_offsets = concatenate_ragged([sample.pixels for sample in samples])
    points, point_offsets = concatenate_ragged([c for sample in samples for c in sample.contours])
    images = [np.zeros(0, np.uint8) if s.image is None else _quantised(s.image).ravel() for s in samples]
    links, link_offsets = concatenate_ragged([graph.links for graph in graphs])
    return {
        "pixels/points": pixels.astype(np.int16),
        "pixels/offsets": pixel_offsets,
        "links/nodes": links.astype(np.int16),
        "links/label": np.concatenate(labels).astype(np.int8),
        "links/offsets": link_offsets,
        "triangles/inside": np.rint(255 * np.concatenate(shares)).astype(np.uint8),
        "triangles/offsets": np.concatenate([[0], np.cumsum([len(y) for y in shares])]),
        "contours/points": points.astype(np.int16),
        "contours/offsets": point_offsets,
        "contours/graph": np.repeat(np.arange(len(samples)), [len(s.contours) for s in samples]),
        "images/values": np.concatenate(images),
        "images/offsets": np.concatenate([[0], np.cumsum([image.size for image in images])]),
        "shape": np.array([sample.shape for sample in samples], np.int32),
        "kind": np.array([ALL_KINDS.index(sample.kind) for sample in samples], np.uint8),
    }


def generate_graphs(settings: Mapping, seed: int, path: str | Path) -> None:
    """Draw the frozen training, validation and test graphs and write ``graphs.h5``.

    Parameters
    ----------
    settings : mapping
        ``graphs``: how many of each split; the other keys of the ``gnn`` section are not looked at.
    seed : int
    path : path
    """
    splits, nodes = {}, []
    for number, split in enumerate(SPLITS):
        kinds = _kinds(settings["graphs"][split])
        streams = [np.random.default_rng([seed, _FROZEN, number, n]) for n in range(len(kinds))]
        samples = [draw_sample(rng, kind) for rng, kind in zip(streams, kinds, strict=True)]
        splits[split] = _pack(samples)
        nodes += [len(sample.pixels) for sample in samples]
    attributes = {
        "seed": seed,
        "kinds": ",".join(ALL_KINDS),
        "bytes": sum(_nbytes(columns) for columns in splits.values()),
        "bytes_images": sum(columns["images/values"].nbytes for columns in splits.values()),
        "bytes_dense": sum(map(_dense_bytes, nodes)),
        "bytes_paper": PAPER_GRAPHS
        * _nbytes(_pack(large_maps(seed, _PAPER_SHOWN, PAPER_NODES)))
        // _PAPER_SHOWN,
        "bytes_paper_dense": PAPER_GRAPHS * _dense_bytes(PAPER_NODES),
    }
    write_graphs(path, splits, attributes)
    logger.info("graphs: %s; %d bytes on disk", attributes, Path(path).stat().st_size)


def _nbytes(columns: Mapping[str, np.ndarray]) -> int:
    """Bytes of a split's graphs and labels; grey slices are not part of a graph."""
    return sum(array.nbytes for name, array in columns.items() if not name.startswith("images"))


def _dense_bytes(nodes: int) -> int:
    """Two dense float32 matrices of a graph, adjacency and labels, as section 4.3 keeps them."""
    return 2 * 4 * nodes**2


def large_maps(seed: int, count: int, nodes: int) -> list[Sample]:
    """Draw maps of exactly ``nodes`` pixels: some organs side by side, the last pixels left out."""
    samples = []
    for number in range(count):
        rng = np.random.default_rng([seed, _PAPER, number])
        parts: list[Sample] = []
        while sum(len(part.pixels) for part in parts) < nodes:
            parts.append(draw_sample(rng, "mixed"))
        height = max(part.shape[0] for part in parts)
        shift = np.cumsum([0, *(part.shape[1] for part in parts)])
        pixels, contours = [], []
        for part, at in zip(parts, shift, strict=False):
            aside = np.array([0, at], np.int32)
            pixels.append(part.pixels + aside)
            contours += [contour + aside for contour in part.contours]
        shape = (height, int(shift[-1]))
        samples.append(Sample(np.concatenate(pixels)[:nodes], contours, "mixed", shape))
    return samples


def read_samples(path: str | Path, split: str) -> list[Sample]:
    """Boundary maps of a frozen split (``training``, ``validation`` or ``test``) with their truth."""
    columns = read_graphs(path, split)
    contours = np.split(columns["contours/points"].astype(np.int32), columns["contours/offsets"][1:-1])
    owner = columns["contours/graph"]
    samples = []
    for n, (kind, shape) in enumerate(zip(columns["kind"], columns["shape"], strict=True)):
        pixels = slice(*columns["pixels/offsets"][n : n + 2])
        values = columns["images/values"][slice(*columns["images/offsets"][n : n + 2])]
        samples.append(
            Sample(
                columns["pixels/points"][pixels].astype(np.int32),
                [contours[c] for c in np.flatnonzero(owner == n)],
                ALL_KINDS[kind],
                (int(shape[0]), int(shape[1])),
                values.reshape(shape).astype(np.float32) if values.size else None,
            )
        )
    return samples


# Examples ---------------------------------------------------------------------------------------------


@dataclass
class _Examples:
    """A batch with its labels and weights; every slice weighs the same."""

    batch: Batch
    inside: Tensor  # (T,) share of the triangle's area inside
    inside_weight: Tensor
    true: Tensor  # (L,)
    true_weight: Tensor
    extent: Tensor  # (T,) what a triangle's logit weighs in the cut; 0 at the ring
    length: Tensor  # (L,) what a link's costs in the cut
    graph: Complex

    def to(self, device: torch.device | str) -> _Examples:
        """Move all tensors; the graph stays."""
        moved = {n: v if isinstance(v, Complex) else v.to(device) for n, v in vars(self).items()}
        return _Examples(**moved)


def _examples(samples: Sequence[Sample], hide_grey: Sequence[bool]) -> _Examples:
    graphs, greys, shares, weights = [], [], [], []
    for sample, hidden in zip(samples, hide_grey, strict=True):
        graph, grey = read_map(sample.pixels, None if hidden else sample.image)
        shares.append(inside_shares(graph, sample.contours))
        # a triangle's weight follows its extent, as in the cut; what touches the ring is known
        weight = np.where(graph.outer, 0, np.clip(np.sqrt(graph.areas), 0.7, 12))
        weights.append(weight / weight.sum())
        graphs.append(graph)
        greys.append(grey)
    joined = join_complexes(graphs)
    inside = np.concatenate(shares)
    link_counts = np.diff(joined.link_offsets)

    def real(array):
        return torch.from_numpy(np.asarray(array, np.float32))

    return _Examples(
        make_batch(joined, measure(joined, greys)),
        real(inside),
        real(np.concatenate(weights) / len(samples)),
        real(link_labels(joined, inside)),
        real(np.repeat(1 / link_counts, link_counts) / len(samples)),
        real(np.where(joined.outer, 0, joined.areas**AREA_POWER)),
        real(BORDER_COST * joined.link_lengths),
        joined,
    )


class _Stream(Dataset):
    """Batches of one epoch: the frozen maps in a new order, among fresh ones drawn from the seed."""

    def __init__(self, frozen: Sequence[Sample], settings: Mapping, seed: int, epoch: int):
        self.frozen, self.seed, self.epoch = frozen, seed, epoch
        order = np.random.default_rng([seed, _ORDER, epoch])
        total = len(frozen) + settings["fresh_maps"]
        size = settings["batch_size"]
        shuffled = order.permutation(total)
        self.batches = [shuffled[n : n + size] for n in range(0, total - size + 1, size)] or [shuffled]
        weights = np.array([KIND_WEIGHTS[kind] for kind in ALL_KINDS], float)
        self.kinds = order.choice(len(ALL_KINDS), total, p=weights / weights.sum())

    def __len__(self) -> int:
        return len(self.batches)

    def __getitem__(self, index: int) -> _Examples:
        samples = []
        for number in self.batches[index]:
            if number < len(self.frozen):
                samples.append(self.frozen[number])
            else:
                rng = np.random.default_rng([self.seed, _FRESH, self.epoch, number])
                samples.append(draw_sample(rng, ALL_KINDS[self.kinds[number]]))
        hiding = np.random.default_rng([self.seed, _HIDING, self.epoch, index])
        return _examples(samples, hiding.random(len(samples)) < _HIDDEN_GREY)


def _only(batch: list[_Examples]) -> _Examples:
    return batch[0]


# Training ---------------------------------------------------------------------------------------------


def _cut_loss(inside: Tensor, link: Tensor, examples: _Examples) -> Tensor:
    """How much worse the true cut is than the least one: the structured hinge loss.

    The least cut is sought with every wrong triangle `_MARGIN` nats cheaper, so that the true one wins by a
    margin (Tsochantaridis et al. 2005; Szummer, Kohli and Hoiem 2008 for graph cuts). Mean over triangles
    by extent.
    """
    graph, extent = examples.graph, examples.extent
    gain, cost = inside * extent, examples.length * nn.functional.softplus(-link)
    share = examples.inside
    truth = (share > 0.5) & (extent > 0)
    margin = _MARGIN * extent * (1 - 2 * share)
    offered = (gain + margin).detach().double().cpu().numpy()
    offered[graph.outer] = -1e9
    least = minimum_cut(
        offered,
        cost.detach().double().cpu().numpy(),
        graph.neighbours,
        graph.side_links,
        graph.triangle_offsets,
    )
    least = torch.from_numpy(least).to(gain.device)
    first, second = examples.batch.sides
    crossed, due = (label[first] != label[second] for label in (least, truth))
    change = least.float() - truth.float()
    worse = ((gain + margin) * change).sum() - (cost * (crossed.float() - due.float())).sum()
    return worse / extent.sum()


def _loss(model: JunctionNetwork, examples: _Examples) -> Tensor:
    """Mean over slices of the triangles' and the links' cross entropy, and the loss of the cut."""
    inside, link = model(examples.batch)
    cross_entropy = nn.functional.binary_cross_entropy_with_logits
    cells = cross_entropy(inside, examples.inside, examples.inside_weight, reduction="sum")
    links = cross_entropy(link, examples.true, examples.true_weight, reduction="sum")
    return cells + links + _CUT_WEIGHT * _cut_loss(inside, link, examples)


def _validate(
    model: JunctionNetwork, samples: Sequence[Sample], prepared: Sequence[_Examples]
) -> dict[str, float]:
    """Link precision, recall and F1, and the share of slices that the decoder gets right."""
    true_positive = positive = true = 0.0
    masks, origins = [], []
    for examples in prepared:
        inside, link = model.predict(examples.batch)
        predicted, label = link > 0, examples.true.numpy() > 0.5
        true_positive += (predicted & label).sum()
        positive += predicted.sum()
        true += label.sum()
        filled, origin = fill_inside(examples.graph, label_inside(examples.graph, inside, link))
        masks.append(filled)
        origins += [origin] * len(filled)
    scores = []
    layers = [layer for part in masks for layer in part]
    for layer, origin, sample in zip(layers, origins, samples, strict=True):
        curves = curves_from_masks(layer[None], (0, *origin), _FLAT)
        scores.append(score_slice(list(curves) if len(curves) else [], sample.contours))
    precision, recall = true_positive / max(positive, 1), true_positive / max(true, 1)
    return {
        "link_precision": float(precision),
        "link_recall": float(recall),
        "link_f1": float(2 * precision * recall / max(precision + recall, 1e-12)),
        "validation_correct": float(np.mean([score.correct for score in scores])),
        "validation_dice": float(np.mean([score.dice for score in scores])),
    }


_FLAT = Frame(np.eye(4), 2, (1, 1, 1))
_NETWORK_KEYS = ("width", "link_width", "pixel_layers", "rounds", "heads", "dropout")


# Weights of an exchange that carry its messages.
_CARRYING = (
    ".give.weight", ".wall.weight", ".wall.bias", ".compare.weight", ".gate.weight", ".gate.bias",
)  # fmt: skip


@torch.no_grad()
def _start_from(model: JunctionNetwork, path: str | Path) -> None:
    """Take a network's weights; what is new (features, messages, exchanges) hardly acts at first."""
    content = _read_model(path)
    for key in ("width", "link_width", "pixel_layers", "heads", "rounds"):
        old, new = content["sizes"][key], model.sizes[key]
        if old != new and (key != "rounds" or old > new):  # exchanges may be added
            hint = f"set gnn.{key} to {old}, or gnn.start to null"
            raise InputError(str(path), f"its {key} is not {new}", hint)
    for name, value in model.state_dict().items():
        if name.endswith(_CARRYING):
            value.mul_(0.1)
        old = content["weights"].get(name)
        if old is not None:
            if value.ndim == 2:
                value[:, old.shape[1] :] = 0  # what the old network did not read
            value[tuple(slice(n) for n in old.shape)] = old


def _fingerprint(graphs_path: str | Path, settings: Mapping, seed: int) -> str:
    """Digest what a checkpoint must have in common with a run to be resumed by it."""
    graphs = hashlib.sha256(Path(graphs_path).read_bytes()).hexdigest()
    chosen = {key: value for key, value in settings.items() if key != "pretrained"}
    return hashlib.sha256(json.dumps([graphs, chosen, seed], sort_keys=True).encode()).hexdigest()


def _checkpoints(folder: Path) -> list[Path]:
    """Checkpoints, newest first."""
    return sorted(folder.glob("epoch_*.pt"), reverse=True)


def _save(path: Path, content: dict) -> None:
    buffer = io.BytesIO()  # torch reports a full disk as an internal error
    torch.save(content, buffer)
    with atomic_path(path) as temporary:
        temporary.write_bytes(buffer.getbuffer())


def _resume(folder: Path, fingerprint: str) -> dict | None:
    """Read the newest checkpoint that is whole and belongs to this run."""
    for path in _checkpoints(folder):
        try:
            state = torch.load(path, weights_only=True, map_location="cpu")
            if state["fingerprint"] == fingerprint:
                logger.info("resuming after %s", path.name)
                return state
        except Exception as error:  # whatever a torn file makes the reader raise
            logger.warning("%s cannot be read (%s); trying the one before", path.name, error)
    return None


def train_model(
    graphs_path: str | Path,
    settings: Mapping,
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
        From `generate_graphs`.
    settings : mapping
        The ``gnn`` section of the configuration.
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
    folder = Path(checkpoint_dir)
    folder.mkdir(parents=True, exist_ok=True)
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    torch.set_num_threads(1)
    torch.manual_seed(seed)
    frozen = read_samples(graphs_path, "training")
    validation = read_samples(graphs_path, "validation")
    if not frozen or not validation:
        raise InputError("config gnn.graphs", "training or validation is empty", "draw at least one of each")
    prepared = [_examples([sample], [False]) for sample in validation]
    model = JunctionNetwork(**{key: settings[key] for key in _NETWORK_KEYS}).to(device)
    if settings["start"]:
        _start_from(model, settings["start"])
    optimiser = torch.optim.AdamW(model.parameters(), lr=settings["learning_rate"], weight_decay=1e-4)
    steps = settings["epochs"] * len(_Stream(frozen, settings, seed, 0))
    schedule = torch.optim.lr_scheduler.OneCycleLR(
        optimiser, settings["learning_rate"], total_steps=steps + 1, pct_start=0.1, cycle_momentum=False
    )
    fingerprint = _fingerprint(graphs_path, settings, seed)
    history: list[dict] = []
    best: dict = {"score": -1.0, "epoch": -1, "weights": None}
    state = _resume(folder, fingerprint)
    if state is not None:
        model.load_state_dict(state["model"])
        optimiser.load_state_dict(state["optimiser"])
        schedule.load_state_dict(state["schedule"])
        torch.set_rng_state(state["random"])
        history, best = state["history"], state["best"]
    for epoch in range(len(history), settings["epochs"]):
        if epoch - best["epoch"] > settings["patience"] and best["epoch"] >= 0:
            logger.info("no better than epoch %d for %d epochs: done", best["epoch"], settings["patience"])
            break
        begun = time.perf_counter()
        loss = _run_epoch(model, optimiser, schedule, _Stream(frozen, settings, seed, epoch), threads, device)
        row = {"epoch": epoch, "loss": loss, **_validate(model, validation, prepared)}
        row["seconds"] = round(time.perf_counter() - begun, 2)
        row["device"] = (
            torch.cuda.get_device_name(device) if device.type == "cuda" else f"CPU, {threads} threads"
        )
        history.append(row)
        logger.info("%s", row)
        # few slices are on the edge of correct; the mean with Dice tells epochs apart with less noise
        score = (row["validation_correct"] + row["validation_dice"]) / 2
        if score > best["score"]:
            weights = {name: value.detach().cpu().clone() for name, value in model.state_dict().items()}
            best = {"score": float(score), "epoch": epoch, "weights": weights}
        _save(
            folder / f"epoch_{epoch:04d}.pt",
            {
                "fingerprint": fingerprint,
                "model": model.state_dict(),
                "optimiser": optimiser.state_dict(),
                "schedule": schedule.state_dict(),
                "random": torch.get_rng_state(),
                "history": history,
                "best": best,
            },
        )
        for old in _checkpoints(folder)[2:]:
            old.unlink()
    _save(Path(model_path), {"sizes": model.sizes, "weights": best["weights"], "seed": seed})
    with atomic_path(history_path) as temporary:
        pd.DataFrame(history).to_csv(temporary, index=False)
    logger.info("best epoch %d; %.0f s in this process", best["epoch"], time.perf_counter() - started)


def _run_epoch(model, optimiser, schedule, stream: _Stream, threads: int, device: torch.device) -> float:
    """One pass over a stream; returns the mean loss."""
    model.train()
    workers = max(0, min(threads, os.cpu_count() or 1) - 1)
    loader = DataLoader(stream, batch_size=1, collate_fn=_only, num_workers=workers)
    total = 0.0
    for examples in tqdm(loader, desc=f"epoch {stream.epoch}", unit="batch", mininterval=2):
        if device.type != "cpu":
            examples = examples.to(device)
        loss = _loss(model, examples)
        optimiser.zero_grad(set_to_none=True)
        loss.backward()
        nn.utils.clip_grad_norm_(model.parameters(), 1.0)
        optimiser.step()
        schedule.step()
        total += float(loss.detach())
    return total / len(stream)


def _read_model(path: str | Path) -> dict:
    try:
        content = torch.load(path, weights_only=True, map_location="cpu")
        return {key: content[key] for key in ("sizes", "weights")}
    except Exception as error:  # torch raises many kinds
        raise _foreign(path, type(error).__name__) from error


def _foreign(path: str | Path, why: str) -> InputError:
    problem = f"not a junction model of this version ({why})"
    return InputError(str(path), problem, "name another in gnn.pretrained, or train one")


def load_model(path: str | Path) -> JunctionNetwork:
    """Read a trained network, ready for prediction, on the CPU or on the GPU where there is one.

    Raises
    ------
    InputError
        When the file is not one that `train_model` wrote.
    """
    content = _read_model(path)
    try:
        model = JunctionNetwork(**content["sizes"])
        model.load_state_dict(content["weights"])
    except (TypeError, RuntimeError) as error:
        raise _foreign(path, "its weights do not fit") from error
    return model.eval().to("cuda" if torch.cuda.is_available() else "cpu")
