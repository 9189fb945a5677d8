"""How a trained network's score depends on the number of its training graphs (the paper's section 8).

    python bench/training_graphs.py [--table FILE]
    python bench/training_graphs.py --families [--table FILE] [--models FOLDER]

Both networks are trained on 25, 70 and 200 frozen training graphs of the default seed, and on no others; the
fewer there are, the more epochs, so that all take as many steps. The same few graphs choose the epoch, the
same 50 are scored. These are short trainings, of some six CPU minutes together. The table that is committed
is docs/measured/training_graphs.csv.

``--families`` asks instead how our network's score depends on how many maps it saw, and of how many families
(`cccd_training.junctions.families`; `DAMAGE` is the training's own generator). One family is left out at a
time and scored beside those seen, as are the maps of `out_of_distribution`, which no family draws. Some start
from the shipped weights, which know `DAMAGE` alone. “True labels” is what the decoder would give of a network
without fault. The table is docs/training_families.csv; it takes some five minutes of one core, and a killed
run goes on from the models in FOLDER.
"""

from one_core import ROOT  # isort: skip

import argparse
import sys
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd

from cccd.settings.root import Settings
from cccd_junctions.checkpoint import load_model, read_model, save_model
from cccd_junctions.network import JunctionNetwork
from cccd_networks.settings import NetworkSettings
from cccd_paper.comparisons.junction_comparison import by_true_labels
from cccd_training.junctions.families import FAMILIES
from cccd_training.junctions.frozen_graphs import generate_graphs
from cccd_training.junctions.loop import train_model, train_task
from cccd_training.junctions.scoring import score_slice
from cccd_training.junctions.synthetic_maps import (
    ALL_KINDS,
    KIND_WEIGHTS,
    RandomStream,
    SyntheticMap,
    draw_map,
)
from cccd_training.junctions.tasks import make_task

COUNTS = (25, 70, 200)
#: Epochs over the largest number of graphs, and graphs per step of our network.
EPOCHS, BATCH = 4, 4
#: Graphs that choose the epoch.
VALIDATION = 10

#: The training's own generator as a family, and all of them.
DAMAGE = "damage"
ALL = (DAMAGE, *FAMILIES)
#: Maps of a training in all, drawn evenly from its families; each is seen once.
SIZES = (600, 1200)
#: Peak rate of those that go on from the shipped weights, whose last stage peaked at 0.0011.
RATE = 0.0008
#: Maps on which each family is scored.
SCORED = 60
SHIPPED = ROOT / "workflow" / "models" / "junctions.pt"


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


def family_maps(family: str, count: int, stream: RandomStream) -> list[SyntheticMap]:
    """Draw maps of one family by the default seed; of `DAMAGE` as often of each kind as training does."""
    numbers = [Settings().seed, stream, 100 + ALL.index(family)]
    weights = np.array([KIND_WEIGHTS[kind] for kind in ALL_KINDS])
    kinds = np.random.default_rng(numbers).choice(ALL_KINDS, count, p=weights / weights.sum())
    streams = [np.random.default_rng([*numbers, n]) for n in range(count)]
    return [
        draw_map(rng, kind if family == DAMAGE else family) for rng, kind in zip(streams, kinds, strict=True)
    ]


def family_trainings() -> list[tuple[tuple[str, ...], int, bool]]:
    """Families that a training sees, its maps, and whether it starts from the shipped weights.

    The shipped weights know `DAMAGE`, so what leaves that out starts from nothing.
    """
    fewer, more = SIZES
    without = {left: tuple(family for family in ALL if family != left) for left in ALL}
    on = [(ALL, fewer, True), ((DAMAGE,), fewer, True), *((without[left], fewer, True) for left in FAMILIES)]
    fresh = [(ALL, fewer, False), (without[DAMAGE], fewer, False)]
    return [*on, *fresh, (ALL, more, True)]


def trained_on(seen: tuple[str, ...], count: int, further: bool, path: Path) -> JunctionNetwork:
    """Train on so many maps, as many of each family, unless the model is there."""
    if not path.exists():
        seed, settings = Settings().seed, NetworkSettings(fresh_maps=0, epochs=1)
        if further:
            layers = read_model(SHIPPED)["sizes"]["message_layers"]
            start = {"start": str(SHIPPED), "learning_rate": RATE, "message_layers": layers}
            settings = settings.model_copy(update=start)
        drawn = [family_maps(family, count // len(seen), RandomStream.FRESH_MAPS) for family in seen]
        model = train_task(make_task([one for maps in drawn for one in maps], settings, seed), seed)
        save_model(path, "ours", model.sizes, model.state_dict(), seed)
    return load_model(path)


def family_scores(table: Path, folder: Path) -> None:
    """Train and score; rows are written as they come."""
    from out_of_distribution import unseen_maps

    folder.mkdir(parents=True, exist_ok=True)
    unseen = unseen_maps()
    scored = {family: family_maps(family, SCORED, RandomStream.EVALUATION) for family in ALL}
    scored |= {"organs, other damage": [one for kind in unseen for one in unseen[kind]]}
    rows = [
        _row("true labels", 0, (), family, maps, _by_true_labels(maps)) for family, maps in scored.items()
    ]
    task = make_task([], NetworkSettings(), 0)
    for seen, count, further in [((DAMAGE,), 0, True), *family_trainings()]:
        start = "shipped" if further else "nothing"
        model = (
            trained_on(seen, count, further, folder / f"{start}_{'-'.join(seen)}_{count}.pt")
            if count
            else load_model(SHIPPED)
        )
        for family, maps in scored.items():
            rows.append(_row(start, count, seen, family, maps, task.score(model, maps)))
            print(rows[-1], file=sys.stderr, flush=True)
        pd.DataFrame(rows).to_csv(table, index=False, float_format="%.4f")


def _by_true_labels(maps: list[SyntheticMap]) -> dict[str, float]:
    """Score what a network without fault would give: no network can have more."""
    scores = [
        score_slice(chains, one.contours) for chains, one in zip(by_true_labels(maps), maps, strict=True)
    ]
    return {name: float(np.mean([getattr(score, name) for score in scores])) for name in ("correct", "dice")}


def _row(start: str, count: int, seen: tuple[str, ...], scored: str, maps: list, found: dict) -> dict:
    return {
        "start": start, "training_maps": count, "families": len(seen), "seen": " ".join(seen),
        "scored": scored, "left_out": bool(seen) and scored not in seen, "maps": len(maps),
        **{name: found.get(name) for name in ("link_f1", "correct", "dice")},
    }  # fmt: skip


def main() -> None:
    """Train every size of both networks, or on every choice of families; rows are written as they come."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--table", type=Path)
    parser.add_argument("--families", action="store_true", help="maps and families instead of graphs")
    parser.add_argument("--models", type=Path, default=Path("training_families"), help="with --families")
    arguments = parser.parse_args()
    name = "training_families.csv" if arguments.families else "measured/training_graphs.csv"
    table, rows = arguments.table or ROOT / "docs" / name, []
    if arguments.families:
        family_scores(table, arguments.models)
        return
    for network in ("paper", "ours"):
        for count in COUNTS:
            rows.append(score(network, count))
            print(rows[-1], file=sys.stderr)
            pd.DataFrame(rows).to_csv(table, index=False, float_format="%.4f")


if __name__ == "__main__":
    main()
