"""The learning curve of a training as a picture."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from cccd.store import atomic_path


def draw_learning_curve(path: str | Path, history: pd.DataFrame) -> None:
    """Draw loss and held-out Dice by epoch."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(figsize=(6, 3.5), layout="constrained")
    axes.plot(history["epoch"] + 1, history["loss"], color="tab:gray", label="loss, training")
    axes.set(xlabel="epoch", ylabel="Dice loss + cross entropy", ylim=(0, None))
    beside = axes.twinx()
    for name in history.columns[history.columns.str.startswith("dice")]:
        beside.plot(history["epoch"] + 1, history[name], label=name.replace("_", ", label "))
    beside.set(ylabel="Dice, held-out patients", ylim=(0, 1))
    figure.legend(loc="outside upper center", ncols=4, frameon=False)
    with atomic_path(path) as temporary:
        figure.savefig(temporary, format="png", dpi=120)
    plt.close(figure)
