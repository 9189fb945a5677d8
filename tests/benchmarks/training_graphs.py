"""How a trained network's score depends on the number of its training graphs (the paper's section 8).

    python tests/benchmarks/training_graphs.py [--table FILE]

Both networks are trained on 25, 70 and 200 frozen training graphs of the default seed, and on no others; the
fewer there are, the more epochs, so that all take as many steps. The same few graphs choose the epoch, the
same 50 are scored. These are short trainings, of some six CPU minutes together. The table that is committed
is docs/training_graphs.csv.
"""

import argparse
import os
import sys
import tempfile
from pathlib import Path

for library in ("OMP", "OPENBLAS", "MKL", "NUMBA"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "scripts")]

import pandas as pd  # noqa: E402

from cccd.settings.junctions import NetworkSettings  # noqa: E402
from cccd.settings.root import Settings  # noqa: E402
from cccd_training.junctions.frozen_graphs import generate_graphs  # noqa: E402
from cccd_training.junctions.loop import train_model  # noqa: E402

__all__ = ["trained_scores"]

COUNTS = (25, 70, 200)
#: Epochs over the largest number of graphs, and graphs per step of our network.
EPOCHS, BATCH = 4, 4
#: Graphs that choose the epoch.
VALIDATION = 10


def trained_scores(settings: NetworkSettings) -> dict[str, float]:
    """Train a network by the default seed, and return its scores on the test graphs."""
    seed = Settings().seed
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        graphs, history = folder / "graphs.h5", folder / "history.csv"
        generate_graphs(settings.graphs, seed, graphs)
        train_model(graphs, settings, seed, folder / "checkpoints", folder / "model.pt", history, 1)
        rows = pd.read_csv(history).dropna(subset=["test_correct"])
    return rows[[name for name in rows if name.startswith("test_")]].iloc[0].to_dict()


def score(network: str, count: int) -> dict[str, float | int | str]:
    """Train one network on so many graphs, and return its scores on the test graphs."""
    plain = NetworkSettings()
    epochs = round(EPOCHS * max(COUNTS) / count)
    graphs = plain.graphs.model_copy(update={"training": count, "validation": VALIDATION})
    settings = plain.model_copy(
        update={
            "network": network,
            "graphs": graphs,
            "fresh_maps": 0,
            "batch_size": BATCH,
            "paper": plain.paper.model_copy(update={"epochs": epochs}),
            "epochs": epochs,
            "patience": epochs,
        }
    )
    return {"network": network, "training_graphs": count, "epochs": epochs, **trained_scores(settings)}


def main() -> None:
    """Train every size of both networks; rows are written as they come."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--table", type=Path, default=ROOT / "docs" / "training_graphs.csv")
    table, rows = parser.parse_args().table, []
    for network in ("paper", "ours"):
        for count in COUNTS:
            rows.append(score(network, count))
            print(rows[-1], file=sys.stderr)
            pd.DataFrame(rows).to_csv(table, index=False, float_format="%.4f")


if __name__ == "__main__":
    main()
