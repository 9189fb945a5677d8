"""The paper's network and ours, trained on the same number of maps and scored on the same others.

    nice -n 10 python bench/equal_maps.py

The default run trains ours on 200 frozen maps and 2,000 fresh ones, 3,000 passes over maps in all, and the
paper's network on its own 200 graphs, 1,600 passes. Here the paper's passes 3,000 as well, twice 1,500
different ones (the two trainings of `paper_network`). The shipped weights are scored beside them.
Everything is drawn from the default seed. Scored are maps as in the run's junction table, more of each kind
(in distribution), and those of `out_of_distribution`. The committed table is docs/equal_maps.csv; the
models stay in --folder, and a killed run goes on from there.
"""

from one_core import ROOT  # isort: skip

import argparse
from collections.abc import Iterator
from pathlib import Path

import pandas as pd
import paper_network
from out_of_distribution import unseen_maps

from cccd.settings.root import Settings
from cccd_junctions.checkpoint import load_model
from cccd_networks.settings import NetworkSettings
from cccd_paper.comparisons.junction_comparison import (
    TEN,
    compare_decoders,
    draw_test_maps,
    network_decoder,
)
from cccd_paper.junctions.network import PaperNetwork
from cccd_paper.junctions.training import PaperTask
from cccd_training.junctions.loop import train_model
from cccd_training.junctions.tasks import make_task

#: Test maps of each kind.
TEST_MAPS = 30

#: Maps that the shipped weights were trained on (workflow/models/README.md).
SHIPPED_MAPS = 391_000


def papers_networks(folder: Path) -> Iterator[tuple[int, int, PaperNetwork]]:
    """Train the paper's network on the run's graphs and on more: different maps, passes, network."""
    sweep, settings = paper_network, NetworkSettings(network="paper")
    few, epochs = settings.graphs.training, settings.paper.epochs
    channels = settings.paper.sizes["channels"]
    rate = PaperTask([], settings, Settings().seed).learning_rate
    for maps, passes in ((few, epochs), (sweep.MORE_MAPS, sweep.MORE_EPOCHS)):
        yield maps, maps * passes, sweep.trained(folder, sweep.Training(maps, passes, channels, rate))[0]


def our_network(folder: Path) -> tuple[int, int, Path]:
    """Train ours as the default run does: different maps, passes, weights."""
    settings, seed = NetworkSettings(), Settings().seed
    few, fresh, epochs = settings.graphs.training, settings.fresh_maps, settings.epochs
    model, history = folder / "ours.pt", folder / "ours.csv"
    if not model.exists():
        graphs = paper_network.graphs_of(folder, few)
        train_model(graphs, settings, seed, folder / "ours_checkpoints", model, history, 1)
    return few + fresh * epochs, (few + fresh) * epochs, model


def scores(network: str, model, maps: dict) -> pd.DataFrame:
    """Correct maps, Dice and F1 of the links: of the ten kinds together, and of every other kind."""
    task = make_task([], NetworkSettings(network=network), 0)
    table, _ = compare_decoders({network: network_decoder(model)}, maps)
    table = table.set_index("kind")
    f1 = pd.Series({kind: task.score(model, drawn)["link_f1"] for kind, drawn in maps.items()})
    f1["all ten"] = f1[list(TEN)].mean()
    table = table.assign(link_f1=f1).drop(index=list(TEN)).reset_index()
    return table[["kind", "maps", "correct", "dice", "link_f1"]]


def main() -> None:
    """Train and score every network, and write the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--table", type=Path, default=ROOT / "docs" / "equal_maps.csv")
    parser.add_argument("--folder", type=Path, default=Path("equal_maps"))
    arguments = parser.parse_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    maps = draw_test_maps(Settings().seed, TEST_MAPS) | unseen_maps()
    tables = [
        scores("paper", model, maps).assign(network="paper", training_maps=different, map_passes=passes)
        for different, passes, model in papers_networks(arguments.folder)
    ]
    different, passes, path = our_network(arguments.folder)
    trained = scores("ours", load_model(path), maps)
    tables.append(trained.assign(network="ours", training_maps=different, map_passes=passes))
    shipped = scores("ours", load_model(ROOT / "workflow" / "models" / "junctions.pt"), maps)
    tables.append(shipped.assign(network="ours, shipped", map_passes=SHIPPED_MAPS))
    table = pd.concat(tables, ignore_index=True)
    first = ["network", "training_maps", "map_passes"]
    table = table[[*first, *table.columns.difference(first, sort=False)]]
    table.to_csv(arguments.table, index=False, float_format="%.4g")
    print(table.pivot_table(index="kind", columns=["network", "map_passes"], values="correct").to_string())


if __name__ == "__main__":
    main()
