"""The junction network beside its own decoder and the classical ones, on the same maps in one run."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import cast

import cv2
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.collections import LineCollection

from cccd.containers import Boundaries, Frame
from cccd.geometry.arrays import concatenate_ragged
from cccd.store import atomic_path, write_table
from cccd_datasets.corruptions import KINDS
from cccd_junctions.checkpoint import load_model
from cccd_junctions.decoding import fill_inside
from cccd_junctions.inference import LoopPredictor, Predictor, predict_masks
from cccd_junctions.labelling import label_slice
from cccd_junctions.network import JunctionNetwork
from cccd_junctions.observation import observe
from cccd_junctions.ordering import order_boundaries
from cccd_networks.settings import NetworkSettings
from cccd_paper.comparisons.baselines.decoders import DECODERS
from cccd_paper.comparisons.decoders import decode
from cccd_paper.comparisons.timing import timed
from cccd_paper.junctions.network import PaperNetwork
from cccd_training.junctions.labels import inside_shares, link_labels
from cccd_training.junctions.scoring import SliceScore, chains_around, score_slice
from cccd_training.junctions.synthetic_maps import ALL_KINDS, RandomStream, SyntheticMap, draw_map, truth_mask
from cccd_training.junctions.tasks import make_task

#: The kinds whose mean is the table's row "all ten".
TEN = tuple(kind for kind in KINDS if kind != "everything")

#: What is counted of a network's ordering, besides its links.
_CHANGES = ("isolated_corners", "dropped", "bridged")

#: Orders a batch of maps: a list of closed chains (n, 2) for each.
Decoder = Callable[[Sequence[SyntheticMap]], list[list[np.ndarray]]]


def network_decoder(model: Predictor | LoopPredictor | None, grey: bool = True) -> Decoder:
    """Join the network (``None``: no network) and its decoder; without ``grey`` no images are shown."""

    def run(samples: Sequence[SyntheticMap]) -> list[list[np.ndarray]]:
        greys = [sample.image if grey else None for sample in samples]
        masks, origin = predict_masks([sample.pixels for sample in samples], model, greys)
        return [chains_around(mask, origin) for mask in masks]

    return run


def by_true_labels(samples: Sequence[SyntheticMap]) -> list[list[np.ndarray]]:
    """Decode what a network without fault would say."""
    chains: list[list[np.ndarray]] = []
    for sample in samples:
        graph = observe(sample.pixels, sample.image).graph
        inside = inside_shares(graph, sample.contours)
        logits = 20 * (inside - 0.5), np.where(link_labels(graph, inside), 10.0, -10.0)
        (mask,), origin = fill_inside(graph, label_slice(graph, logits, rerank=False).inside)
        chains.append(chains_around(mask, origin))
    return chains


def classical_decoder(decoder: Callable) -> Decoder:
    """Decode each map alone, from its pixels and the point deepest inside the organ."""

    def run(samples: Sequence[SyntheticMap]) -> list[list[np.ndarray]]:
        chains = [decode(decoder, sample.pixels, _seed_point(sample)) for sample in samples]
        return [[chain] if len(chain) else [] for chain in chains]

    return run


def _seed_point(sample: SyntheticMap) -> np.ndarray:
    """Find the point deepest inside the organ: what an ideal user would click."""
    depth = cv2.distanceTransform(truth_mask(sample), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return np.array(np.unravel_index(np.argmax(depth), depth.shape))


def _single(rng: np.random.Generator, kind: str) -> SyntheticMap:
    """Draw a map of one organ without holes, as the classical decoders expect; severity 1."""
    while True:
        sample = draw_map(rng, kind, 1.0)
        if len(sample.contours) == 1:
            return sample


def draw_test_maps(seed: int, count: int) -> dict[str, list[SyntheticMap]]:
    """Draw ``count`` maps of every kind, none of which a training with this seed has seen.

    Their damage is the training's: these maps are in distribution.
    """
    maps: dict[str, list[SyntheticMap]] = {}
    for number, kind in enumerate(ALL_KINDS):
        rng = np.random.default_rng([seed, RandomStream.EVALUATION, number])
        maps[kind] = [_single(rng, kind) for _ in range(count)]
    return maps


def compare_decoders(
    decoders: Mapping[str, Decoder], maps: Mapping[str, Sequence[SyntheticMap]]
) -> tuple[pd.DataFrame, dict[str, dict[str, list[SliceScore]]]]:
    """Score every decoder on the same maps.

    Parameters
    ----------
    decoders : mapping of name to decoder
    maps : mapping of kind to maps

    Returns
    -------
    table : DataFrame
        One row per decoder and kind: ``decoder``, ``kind``, ``maps``, ``correct`` (share of maps),
        ``dice`` (mean), ``hausdorff_px`` (median) and ``ms`` (processor time per map, reading the map
        included, a warm-up on one map of each kind excluded).
    scores : dict
        The scores behind it, by decoder and kind.
    """
    rows, scores = [], {}
    for name, decoder in decoders.items():
        decoder([samples[0] for samples in maps.values()])  # compiles and loads what it needs
        scores[name] = {}
        for kind, samples in maps.items():
            chains, spent = timed(decoder, samples)
            scored = [score_slice(c, s.contours) for c, s in zip(chains, samples, strict=True)]
            scores[name][kind] = scored
            rows.append(
                {
                    "decoder": name,
                    "kind": kind,
                    "maps": len(samples),
                    "correct": np.mean([score.correct for score in scored]),
                    "dice": np.mean([score.dice for score in scored]),
                    "hausdorff_px": np.median([score.hausdorff for score in scored]),
                    "ms": 1000 * spent / len(samples),
                }
            )
    table = pd.DataFrame(rows)
    ten = table[table["kind"].isin(TEN)]
    mean = ten.groupby("decoder", sort=False)[["maps", "correct", "dice", "hausdorff_px", "ms"]].mean()
    mean["maps"] = ten.groupby("decoder", sort=False)["maps"].sum()
    mean = mean.reset_index().assign(kind="all ten")
    return pd.concat([table, mean[table.columns]], ignore_index=True), scores


def _changes(samples: Sequence[SyntheticMap], model: Predictor | LoopPredictor) -> dict[str, float]:
    """Per map: isolated corners (Figure 4), and pixels that the network's ordering dropped and bridged."""
    points, offsets = concatenate_ragged([sample.pixels for sample in samples])
    frame = Frame(np.eye(4), 2, (1, 1, 2 * len(samples)))
    numbers = 2 * np.arange(len(samples), dtype=np.int32)  # none is another's neighbour
    maps = Boundaries(points, offsets, numbers, frame)
    counted = order_boundaries(maps, model)[1]
    return {name: counted[name] / len(samples) for name in _CHANGES}


def _network_rows(
    model: Predictor | LoopPredictor, maps: Mapping[str, Sequence[SyntheticMap]]
) -> dict[str, dict[str, float]]:
    """By kind: the F1 of the links that a network calls true, and what its ordering changes."""
    network = "paper" if isinstance(model, PaperNetwork) else "ours"
    task = make_task([], NetworkSettings(network=network), 0)
    rows: dict[str, dict[str, float]] = {}
    for kind, samples in maps.items():
        rows[kind] = {"link_f1": task.score(model, samples)["link_f1"], **_changes(samples, model)}
    mean = pd.DataFrame([rows[kind] for kind in TEN if kind in rows]).mean()
    return rows | {"all ten": {str(name): float(value) for name, value in mean.items()}}


#: The picture of the worst maps shows at most so many of a kind, so that the hardest kind leaves some room.
_MOST_OF_A_KIND = 2


def draw_worst(
    path: str | Path,
    model: JunctionNetwork,
    samples: Sequence[SyntheticMap],
    scored: Sequence[SliceScore],
    count: int = 10,
) -> None:
    """Draw the maps that score worst: the map, the network's links, the curve and the truth."""
    ranked = pd.DataFrame(
        {
            "kind": [sample.kind for sample in samples],
            "correct": [score.correct for score in scored],
            "dice": [score.dice for score in scored],
        }
    ).sort_values(["correct", "dice"], kind="stable")
    order = ranked.groupby("kind", sort=False).head(_MOST_OF_A_KIND).index[:count]
    drawn = network_decoder(model)([samples[n] for n in order])
    figure, axes = plt.subplots(
        len(order), 3, figsize=(9, 3 * len(order)), squeeze=False, layout="constrained"
    )
    for n, chains, row in zip(order, drawn, axes, strict=True):
        sample = samples[n]
        seen = observe(sample.pixels, sample.image)
        graph = seen.graph
        ((_, link),) = model.logits([seen])
        if sample.image is not None:
            row[0].imshow(sample.image, cmap="gray")
        ink = "k" if sample.image is None else "tab:red"
        row[0].plot(sample.pixels[:, 1], sample.pixels[:, 0], ".", ms=1.5, color=ink)
        row[0].set_title(f"{sample.kind}: map", fontsize=8)
        probability = 1 / (1 + np.exp(-link))
        shown = probability > 0.05
        segments = list(graph.points[graph.links[shown]][:, :, ::-1])
        collection = LineCollection(segments, cmap="viridis", lw=1)
        collection.set_array(probability[shown])
        collection.set_clim(0, 1)
        row[1].add_collection(collection)
        row[1].set_title("links (yellow: true)", fontsize=8)
        for contour in sample.contours:
            row[2].plot(*np.vstack([contour, contour[:1]]).T[::-1], color="tab:green", lw=2.5, label="truth")
        for chain in chains:
            row[2].plot(*np.vstack([chain, chain[:1]]).T[::-1], color="tab:orange", lw=1, label="curve")
        score = scored[n]
        row[2].set_title(f"Dice {score.dice:.3f}, Hausdorff {score.hausdorff:.1f} px", fontsize=8)
        low, high = sample.pixels.min(axis=0) - 4, sample.pixels.max(axis=0) + 4
        for axis in row:
            axis.set(xlim=(low[1], high[1]), ylim=(high[0], low[0]), aspect="equal")
            axis.axis("off")
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=90)
    plt.close(figure)


def evaluate(
    models: Mapping[str, str | Path],
    settings: Mapping,
    seed: int,
    scores_path: str | Path,
    worst_path: str | Path,
) -> None:
    """Write the table of all decoders and the picture of the ten worst maps.

    Parameters
    ----------
    models : mapping of name to path
        Trained networks; the picture is of the last, which is ours.
    settings : mapping
        ``test_maps``: maps per kind.
    seed : int
    scores_path, worst_path : path
        CSV (see `compare_decoders`; of the last network and of the paper's also ``link_f1``,
        and per map ``isolated_corners``, ``dropped`` and ``bridged`` pixels) and PNG.
    """
    maps = draw_test_maps(seed, settings["test_maps"])
    networks = {name: load_model(path) for name, path in models.items()}
    decoders = {f"GNN, {name}": network_decoder(network) for name, network in networks.items()}
    last = list(networks)[-1]
    decoders |= {
        f"GNN, {last}, no image": network_decoder(networks[last], grey=False),
        "decoder alone": network_decoder(None),
        "decoder + true labels": by_true_labels,
    }
    decoders |= {name: classical_decoder(method.run) for name, method in DECODERS.items()}
    table, scores = compare_decoders(decoders, maps)
    measured = {
        f"GNN, {name}": _network_rows(network, maps)
        for name, network in networks.items()
        if name == last or isinstance(network, PaperNetwork)
    }
    for column in ("link_f1", *_CHANGES):
        table[column] = [
            measured.get(decoder, {}).get(kind, {}).get(column, np.nan)
            for decoder, kind in zip(table["decoder"], table["kind"], strict=True)
        ]
    write_table(scores_path, table)
    ours = cast(JunctionNetwork, networks[last])
    samples = [sample for kind in maps for sample in maps[kind]]
    scored = [score for kind in maps for score in scores[f"GNN, {last}"][kind]]
    draw_worst(worst_path, ours, samples, scored)
