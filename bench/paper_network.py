"""The paper's network: a sweep over channels and learning rate, what the best one learns, and where it fails.

    nice -n 15 python bench/paper_network.py --folder paper_network

Every network is Spektral's `GeneralGNN` (`cccd_paper.junctions.general_gnn`), trained on the run's 200 graphs
for the same number of epochs and scored on the 40 validation graphs: F1 of its links, share of maps whose
curves are right, and mean Dice. Forty are too few to choose by (six of them right is .15), so 300 damaged
maps of another seed choose: the one with the most right is trained again on 1,500 maps, which it passes
twice, as many maps as ours passes in a default run. `LONGER` trains further: more passes, and no dropout.
All are scored on the 50 test graphs and on 300 further damaged maps of ten kinds, next to the true links
(with those no network could do better, because chains of neighbouring pixels bridge nothing), to no network
(all links alike), and to batch normalisation by the statistics of ten maps at a time. Of the damaged maps,
``junction_links`` is the median number of true links at pixels with more than two, and ``junction_lost`` the
share of these that is dropped: one opens a curve. The committed table is docs/measured/paper_network.csv. It
takes some 45 minutes of one core; a killed run goes on from the models in the folder.
"""

from one_core import ROOT  # isort: skip

import argparse
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
import torch
from torch_geometric.data import Batch

from cccd.settings.root import Settings
from cccd_junctions.checkpoint import load_model, save_model
from cccd_networks.settings import NetworkSettings
from cccd_paper.comparisons.junction_comparison import TEN, draw_test_maps
from cccd_paper.junctions.grid import build_grid, keep_two
from cccd_paper.junctions.network import PaperNetwork, grid_data
from cccd_paper.junctions.training import PaperTask, grid_labels
from cccd_training.junctions.frozen_graphs import generate_graphs, read_maps
from cccd_training.junctions.loop import train_task

#: Learning rates by channels; 256 channels cost eight times as much as 64, so they get one rate.
RATES = {16: (0.001, 0.003, 0.01, 0.03), 64: (0.001, 0.003, 0.01, 0.03), 256: (0.003,)}
#: Epochs of the sweep.
EPOCHS = 8
#: Maps of the longer training, its passes over them, and test maps of each of ten kinds.
MORE_MAPS, MORE_EPOCHS, TEST_MAPS = 1500, 2, 30

#: Seed of the damaged maps that choose.
CHOOSING_SEED = 153


class Training(NamedTuple):
    """What one network is trained with; the dropout is the paper's."""

    training_maps: int
    epochs: int
    channels: int
    learning_rate: float
    dropout: float = 0.5


#: Further trainings on the 1,500 maps.
LONGER = (
    Training(MORE_MAPS, 8, 16, 0.003),
    Training(MORE_MAPS, 8, 16, 0.01),
    Training(MORE_MAPS, MORE_EPOCHS, 64, 0.003),
    Training(MORE_MAPS, 8, 64, 0.001),
    Training(MORE_MAPS, MORE_EPOCHS, 64, 0.001, dropout=0.0),
)


def damaged_maps(seed: int) -> list:
    """Draw damaged maps of the ten kinds."""
    drawn = draw_test_maps(seed, TEST_MAPS)
    return [one for kind in TEN for one in drawn[kind]]


class NoNetwork:
    """All links alike."""

    def link_scores(self, grids):
        """Give 0."""
        return [np.zeros(len(grid.candidates)) for grid in grids]


class TrueLinks:
    """The labels instead of a network."""

    def __init__(self, maps):
        self.labels = iter([grid_labels(build_grid(drawn.pixels), drawn.contours) for drawn in maps])

    def link_scores(self, grids):
        """Give +1 and -1."""
        return [next(self.labels).astype(float) for _ in grids]


def settings_of(epochs: int) -> NetworkSettings:
    """Settings of the paper's network for a number of epochs."""
    plain = NetworkSettings(network="paper")
    return plain.model_copy(update={"paper": plain.paper.model_copy(update={"epochs": epochs})})


def graphs_of(folder: Path, training: int) -> Path:
    """Draw the frozen graphs, unless they are there."""
    path = folder / f"graphs_{training}.h5"
    if not path.exists():
        counts = NetworkSettings().graphs.model_copy(update={"training": training})
        generate_graphs(counts, Settings().seed, path)
    return path


def trained(folder: Path, wanted: Training) -> tuple[PaperNetwork, float]:
    """Train a network, unless its weights are there; with the processor seconds that it took."""
    path = folder / ("_".join(f"{value:g}" for value in wanted) + ".pt")
    seconds = path.with_suffix(".seconds")
    if not path.exists():
        maps = read_maps(graphs_of(folder, wanted.training_maps), "training")
        task = PaperTask(maps, settings_of(wanted.epochs), Settings().seed)
        task.channels, task.learning_rate = wanted.channels, wanted.learning_rate
        task.dropout = wanted.dropout
        started = time.process_time()
        model = train_task(task, Settings().seed)
        seconds.write_text(f"{time.process_time() - started:.1f}")
        save_model(path, "paper", model.sizes, model.state_dict(), Settings().seed)
    return load_model(path), float(seconds.read_text())


class ByBatch:
    """A network that normalises by the statistics of ten maps at a time, not by those of training."""

    def __init__(self, model: PaperNetwork):
        self.model = model

    @torch.no_grad()
    def link_scores(self, grids):
        """Score as the network does."""
        self.model.train()
        for part in self.model.modules():
            if isinstance(part, torch.nn.Dropout):
                part.eval()
        scores = []
        for begin in range(0, len(grids), 10):
            batch = grids[begin : begin + 10]
            found = self.model(Batch.from_data_list([grid_data(grid) for grid in batch])).double()
            scores += [one.numpy() for one in found.split([len(grid.candidates) for grid in batch])]
        return scores


def at_junctions(model, maps: list) -> dict[str, float]:
    """Count the true links at pixels that have more than two links, and the share of them that is lost."""
    grids, counts = [build_grid(drawn.pixels) for drawn in maps], []
    values = zip(grids, model.link_scores(grids), TrueLinks(maps).link_scores(grids), strict=True)
    for grid, scores, true in values:
        crowded = (np.bincount(grid.candidates.ravel())[grid.candidates] > 2).any(axis=1) & (true > 0)
        kept = keep_two(grid.candidates, scores, len(grid.pixels))
        counts.append((np.count_nonzero(crowded), np.count_nonzero(crowded & ~kept)))
    links, lost = np.array(counts).T
    return {"junction_links": float(np.median(links)), "junction_lost": lost.sum() / links.sum()}


def main() -> None:
    """Sweep, train the best on, and score; rows are written as they come."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--table", type=Path, default=ROOT / "docs" / "measured" / "paper_network.csv")
    parser.add_argument("--folder", type=Path, default=Path("paper_network"))
    arguments = parser.parse_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    few = NetworkSettings().graphs.training
    frozen = graphs_of(arguments.folder, few)
    splits = {split: read_maps(frozen, split) for split in ("validation", "test")}
    choosing = {"validation": splits["validation"], "damaged, another seed": damaged_maps(CHOOSING_SEED)}
    task, rows = PaperTask([], settings_of(EPOCHS), Settings().seed), []

    def score(model, split, maps, wanted=None, seconds=0.0):
        found = task.score(model, maps)
        if split.startswith("damaged"):
            found |= at_junctions(TrueLinks(maps) if isinstance(model, TrueLinks) else model, maps)
        rows.append({**(wanted or Training(0, 0, 0, 0.0, 0.0))._asdict(), "split": split, "maps": len(maps)})
        rows[-1] |= {**found, "train_s": seconds}
        print(rows[-1], flush=True)
        pd.DataFrame(rows).to_csv(arguments.table, index=False, float_format="%.4g")
        return found["correct"]

    found = {}
    for channels, rates in RATES.items():
        for rate in rates:
            wanted = Training(few, EPOCHS, channels, rate)
            model, seconds = trained(arguments.folder, wanted)
            for split, maps in choosing.items():
                found[channels, rate] = score(model, split, maps, wanted, seconds)
    channels, rate = max(found, key=lambda key: found[key])
    kinds = draw_test_maps(Settings().seed, TEST_MAPS)
    scored = {"test": splits["test"], "damaged": damaged_maps(Settings().seed)}
    chosen = (Training(few, EPOCHS, channels, rate), Training(MORE_MAPS, MORE_EPOCHS, channels, rate))
    for wanted in (*chosen, *LONGER):
        model, seconds = trained(arguments.folder, wanted)
        for split, drawn in scored.items():
            score(model, split, drawn, wanted, seconds)
        if wanted == chosen[1]:
            for kind in TEN:
                score(model, f"damaged, {kind}", kinds[kind], wanted, seconds)
            score(ByBatch(model), "damaged, statistics of the batch", scored["damaged"], wanted, seconds)
    for split, drawn in scored.items():
        score(TrueLinks(drawn), f"{split}, true links", drawn)
        score(NoNetwork(), f"{split}, no network", drawn)
    for kind in TEN:
        score(TrueLinks(kinds[kind]), f"damaged, {kind}, true links", kinds[kind])


if __name__ == "__main__":
    main()
