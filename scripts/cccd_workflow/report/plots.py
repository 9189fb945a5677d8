"""Plots of the training, of a whole cohort and of the jobs' times. Each makes SVG of a data frame.

A plot whose columns are not in its table is None: the page then shows the table alone.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.ticker import MaxNLocator

from cccd_workflow.report.html_tables import words
from cccd_workflow.report.svg import DASHES, INK, RULE, SERIES, SOFT, axes, style, to_svg

#: Values whose largest is this many times the smallest are drawn on a logarithmic axis.
_WIDE = 20


def label_of(name: str) -> str:
    """Write a column's name, with its unit."""
    heading, unit = words(name)
    return f"{heading} ({unit})" if unit else heading


def learning_curve(history: pd.DataFrame) -> str | None:
    """Draw loss and scores against the epoch."""
    if "epoch" not in history:
        return None
    numbers = [str(name) for name in history.select_dtypes("number")]
    numeric = [name for name in numbers if name != "epoch" and history[name].nunique() > 1]
    losses = [name for name in numeric if "loss" in name]
    timed = ("second", "time", "rate", "lr", "_s")
    scores = [name for name in numeric if name not in losses and not any(part in name for part in timed)]
    scores = [name for name in scores if history[name].max() <= 1.0][:6]
    panels = [(group, title) for group, title in ((losses, "Loss"), (scores, "Scores")) if group]
    if not panels:
        return None
    with style():
        figure, grid = axes(3.6 * len(panels), 2.7, columns=len(panels))
        for axis, (group, title) in zip(np.atleast_1d(grid), panels, strict=True):
            for number, name in enumerate(group):
                axis.plot(
                    history["epoch"],
                    history[name],
                    color=SERIES[number],
                    linestyle=DASHES[number],
                    label=label_of(name),
                )
            axis.set_title(title)
            axis.set_xlabel("epoch")
            axis.xaxis.set_major_locator(MaxNLocator(integer=True))
            axis.legend(loc="upper left", bbox_to_anchor=(0, -0.2), ncols=2)  # below: it covers no curve
        return to_svg(figure, "learning", "Loss and scores of the training against the epoch")


def strips(frame: pd.DataFrame, columns: list[str], group: str) -> list[str]:
    """Draw one plot per measure: a dot per structure, a row per group, the median as a bar.

    Parameters
    ----------
    frame : pandas.DataFrame
        One row per structure.
    columns : list of str
        Measures; each name is its plot's title.
    group : str
        Column that names the rows of dots.
    """
    plots = []
    names = sorted(frame[group].astype(str).unique())
    shown = names if len(names) <= 12 else ["all"]
    for name in columns:
        if name not in frame or frame[name].notna().sum() == 0:
            continue
        with style():
            figure, axis = axes(4.2, 0.75 + 0.34 * len(shown))
            for row, one in enumerate(shown):
                part = frame if shown == ["all"] else frame[frame[group].astype(str) == one]
                values = part[name].dropna().to_numpy(float)
                # a golden-ratio sequence spreads the dots evenly and is the same in every run
                spread = (np.arange(len(values)) * 0.618034 % 1 - 0.5) * 0.55
                axis.plot(
                    values, row + spread, "o", color=SERIES[0], markersize=3, alpha=0.55, markeredgewidth=0
                )
                if len(values):
                    axis.plot([np.median(values)] * 2, [row - 0.38, row + 0.38], color=INK, linewidth=1.6)
            axis.set_yticks(range(len(shown)), shown)
            axis.set_ylim(len(shown) - 0.5, -0.5)
            axis.grid(axis="y", visible=False)
            axis.set_title(name)
            plots.append(to_svg(figure, f"strip-{name}", f"{name} of every structure"))
    return plots


def ranges(
    names: Sequence[str], values: Sequence[float], ends: Sequence[tuple[float, float]], title: str
) -> str:
    """Draw one dot per structure, one below the other, with a line over its interval.

    Parameters
    ----------
    names : sequence of str
        Of the structures.
    values : sequence of float
    ends : sequence of (float, float)
        Ends of each interval; not finite where there is none.
    title : str
    """
    with style():
        figure, axis = axes(4.6, 0.75 + 0.22 * len(names))
        rows, (low, high) = np.arange(len(names)), np.transpose(ends)
        axis.hlines(rows, low, high, color=SERIES[0], linewidth=3, alpha=0.45)
        axis.plot(values, rows, "o", color=SERIES[0], markersize=4.5, markeredgewidth=0)
        # organs of very different sizes are read on a logarithmic axis
        axis.set_xscale("log" if max(values) > _WIDE * min(values) > 0 else "linear")
        axis.set_yticks(rows, names)
        axis.set_ylim(len(names) - 0.4, -0.6)
        axis.grid(axis="y", visible=False)
        axis.set_title(title)
        return to_svg(figure, f"ranges-{title}", f"{title} of every structure")


def rule_times(benchmarks: pd.DataFrame, most: int = 16) -> str:
    """Draw total time per rule as bars, the slowest on top."""
    shown = benchmarks.head(most)
    with style():
        figure, axis = axes(5.6, 0.6 + 0.22 * len(shown))
        place = np.arange(len(shown))
        axis.barh(place, shown["total_s"], height=0.62, color=SERIES[0])
        for at, seconds, memory in zip(place, shown["total_s"], shown["peak_memory_mb"], strict=True):
            text = f"{seconds:.1f} s" + ("" if pd.isna(memory) else f", {memory:.0f} MB")
            axis.annotate(
                text, (seconds, at), (4, 0), textcoords="offset points", va="center", color=SOFT, size=8
            )
        axis.set_yticks(place, shown["rule"].str.replace("_", " "))
        axis.set_ylim(len(shown) - 0.4, -0.6)
        axis.set_xlim(0, shown["total_s"].max() * 1.3)
        axis.grid(axis="y", visible=False)
        axis.axvline(0, color=RULE)
        axis.set_xlabel("seconds, all jobs together")
        return to_svg(figure, "rule-times", "Time and peak memory per rule")
