"""The paper's network: a sweep over channels and learning rate, and what the best one learns.

    nice -n 15 python tests/benchmarks/paper_network.py --folder paper_network

Every network is Spektral's `GeneralGNN` (`cccd_paper.junctions.general_gnn`), trained on the run's 200 graphs
for the same number of epochs and scored on the 40 validation graphs: F1 of its links, share of maps whose
curves are right, and mean Dice. Forty are too few to choose by (six of them right is .15), so 300 damaged
maps of another seed choose: the one with the most right is trained again on 1,500 maps, which it passes
twice, as many maps as ours passes in a default run. Further trainings pass the 1,500 maps more often
(`LONGER`). All are scored on the 50 test graphs and on 300 further damaged maps of
ten kinds, next to the true links (with those no network could do better, because chains of neighbouring
pixels bridge nothing) and to no network (all links alike). The committed table is
docs/measured/paper_network.csv. It takes some 25 minutes of one core; a killed run goes on from the models in
the folder.
"""

import argparse
import os
import sys
import time
from pathlib import Path

for library in ("OMP", "OPENBLAS", "MKL", "NUMBA"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "scripts")]

import numpy as np  # noqa: E402
import pandas as pd  # noqa: E402

from cccd.settings.junctions import NetworkSettings  # noqa: E402
from cccd.settings.root import Settings  # noqa: E402
from cccd_junctions.checkpoint import load_model, save_model  # noqa: E402
from cccd_paper.comparisons.junction_comparison import TEN, draw_test_maps  # noqa: E402
from cccd_paper.junctions.grid import build_grid  # noqa: E402
from cccd_paper.junctions.network import PaperNetwork  # noqa: E402
from cccd_paper.junctions.training import PaperTask, grid_labels  # noqa: E402
from cccd_training.junctions.frozen_graphs import generate_graphs, read_maps  # noqa: E402
from cccd_training.junctions.loop import train_task  # noqa: E402

#: Learning rates by channels; 256 channels cost eight times as much as 64, so they get one rate.
RATES = {16: (0.001, 0.003, 0.01, 0.03), 64: (0.001, 0.003, 0.01, 0.03), 256: (0.003,)}
#: Epochs of the sweep.
EPOCHS = 8
#: Maps of the longer training, its passes over them, and test maps of each of ten kinds.
MORE_MAPS, MORE_EPOCHS, TEST_MAPS = 1500, 2, 30
#: Channels, learning rates and epochs of trainings that pass the same maps more often.
LONGER = ((16, 0.003, 8), (16, 0.01, 8))

#: Seed of the damaged maps that choose.
CHOOSING_SEED = 153


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


def trained(folder: Path, maps: int, channels: int, rate: float, epochs: int) -> tuple[PaperNetwork, float]:
    """Train a network, unless its weights are there; with the processor seconds that it took."""
    path = folder / f"{maps}_{channels}_{rate:g}_{epochs}.pt"
    seconds = path.with_suffix(".seconds")
    if not path.exists():
        task = PaperTask(read_maps(graphs_of(folder, maps), "training"), settings_of(epochs), Settings().seed)
        task.channels, task.learning_rate = channels, rate
        started = time.process_time()
        model = train_task(task, Settings().seed)
        seconds.write_text(f"{time.process_time() - started:.1f}")
        save_model(path, "paper", model.sizes, model.state_dict(), Settings().seed)
    return load_model(path), float(seconds.read_text())


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

    def score(model, split, maps, training_maps, channels, rate, epochs, seconds):
        found = task.score(model, maps)
        rows.append({
            "training_maps": training_maps, "epochs": epochs, "channels": channels, "learning_rate": rate,
            "split": split, "maps": len(maps), **found, "train_s": seconds,
        })  # fmt: skip
        print(rows[-1], flush=True)
        pd.DataFrame(rows).to_csv(arguments.table, index=False, float_format="%.4g")
        return found["correct"]

    found = {}
    for channels, rates in RATES.items():
        for rate in rates:
            model, seconds = trained(arguments.folder, few, channels, rate, EPOCHS)
            for split, maps in choosing.items():
                found[channels, rate] = score(model, split, maps, few, channels, rate, EPOCHS, seconds)
    channels, rate = max(found, key=lambda key: found[key])
    scored = {"test": splits["test"], "damaged": damaged_maps(Settings().seed)}
    chosen = ((few, channels, rate, EPOCHS), (MORE_MAPS, channels, rate, MORE_EPOCHS))
    for training in (*chosen, *((MORE_MAPS, *longer) for longer in LONGER)):
        model, seconds = trained(arguments.folder, *training)
        for split, drawn in scored.items():
            score(model, split, drawn, *training, seconds)
    for split, drawn in scored.items():
        score(TrueLinks(drawn), f"{split}, true links", drawn, 0, 0, 0, 0, 0)
        score(NoNetwork(), f"{split}, no network", drawn, 0, 0, 0, 0, 0)


if __name__ == "__main__":
    main()
