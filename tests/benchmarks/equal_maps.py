"""The paper's network and ours, trained on the same number of maps and scored on the same others.

    nice -n 10 python tests/benchmarks/equal_maps.py

The default run trains ours on 200 frozen maps and 2,000 fresh ones, 3,000 passes over maps in all, and the
paper's network on its own 200 graphs, 1,600 passes. Here the paper's gets 3,000 different maps of the same
kinds as well, for the 15 epochs of config/paper.yaml: 45,000 passes. The shipped weights are scored beside
them. Everything is drawn from the default seed. Scored are maps as in the run's junction table, more of each
kind (in distribution), and those of `out_of_distribution`. The committed table is docs/equal_maps.csv; the
models stay in --folder, and a killed run goes on from there.
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

import pandas as pd  # noqa: E402
from out_of_distribution import unseen_maps  # noqa: E402

from cccd.junctions.checkpoint import load_model  # noqa: E402
from cccd.settings.junctions import NetworkSettings  # noqa: E402
from cccd.settings.root import Settings  # noqa: E402
from cccd_paper.comparisons.junction_comparison import (  # noqa: E402
    TEN,
    compare_decoders,
    draw_test_maps,
    network_decoder,
)
from cccd_training.junctions.frozen_graphs import generate_graphs  # noqa: E402
from cccd_training.junctions.loop import train_model  # noqa: E402
from cccd_training.junctions.tasks import make_task  # noqa: E402

#: Maps that the paper's network gets, its epochs on them (config/paper.yaml), and test maps of each kind.
MAPS, PAPER_EPOCHS, TEST_MAPS = 3000, 15, 30

#: Maps that the shipped weights were trained on (workflow/models/README.md).
SHIPPED_MAPS = 391_000


def trainings() -> dict[str, tuple[str, int, int, NetworkSettings]]:
    """Network, its different maps, its passes over maps, and its settings, by a name for its files."""
    plain = NetworkSettings()
    many = plain.graphs.model_copy(update={"training": MAPS})
    few, fresh, ours_epochs = plain.graphs.training, plain.fresh_maps, plain.epochs
    paper = plain.model_copy(update={"network": "paper"})
    longer = plain.paper.model_copy(update={"epochs": PAPER_EPOCHS})
    return {
        "paper_default": ("paper", few, few * plain.paper.epochs, paper),
        "paper_equal": (
            "paper",
            MAPS,
            MAPS * PAPER_EPOCHS,
            paper.model_copy(update={"graphs": many, "paper": longer}),
        ),
        "ours_default": ("ours", few + fresh * ours_epochs, (few + fresh) * ours_epochs, plain),
    }


def trained(name: str, settings: NetworkSettings, folder: Path) -> Path:
    """Train a network, unless that is done, and return its weights."""
    seed, model, history = Settings().seed, folder / f"{name}.pt", folder / f"{name}.csv"
    graphs = folder / f"graphs_{settings.graphs.training}.h5"
    if not graphs.exists():
        generate_graphs(settings.graphs, seed, graphs)
    if not model.exists():
        train_model(graphs, settings, seed, folder / f"{name}_checkpoints", model, history, 1)
    return model


def scores(network: str, model_path: Path, maps: dict) -> pd.DataFrame:
    """Correct maps, Dice and F1 of the links: of the ten kinds together, and of every other kind."""
    model = load_model(model_path)
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
    tables = []
    for name, (network, different, passes, settings) in trainings().items():
        started = time.perf_counter()
        scored = scores(network, trained(name, settings, arguments.folder), maps)
        tables.append(scored.assign(network=network, training_maps=different, map_passes=passes))
        print(name, f"{time.perf_counter() - started:.0f} s", file=sys.stderr)
    shipped = scores("ours", ROOT / "workflow" / "models" / "junctions.pt", maps)
    tables.append(shipped.assign(network="ours, shipped", map_passes=SHIPPED_MAPS))
    table = pd.concat(tables, ignore_index=True)
    first = ["network", "training_maps", "map_passes"]
    table = table[[*first, *table.columns.difference(first, sort=False)]]
    table.to_csv(arguments.table, index=False, float_format="%.4g")
    print(table.pivot_table(index="kind", columns=["network", "map_passes"], values="correct").to_string())


if __name__ == "__main__":
    main()
