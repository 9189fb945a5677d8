"""Plots of the tables that go past the paper, and of a whole cohort. Each takes a data frame and gives SVG.

A plot whose columns are not in its table gives None: the page then shows the table alone.
"""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.ticker import MaxNLocator

from cccd.report.svg import DASHES, INK, MARKERS, RULE, SERIES, SOFT, axes, style, to_svg
from cccd.report.tables import words

__all__ = ["learning_curve", "lines", "rule_times", "strips"]


def _label(name: str) -> str:
    heading, unit = words(name)
    return f"{heading} ({unit})" if unit else heading


def learning_curve(history: pd.DataFrame) -> str | None:
    """Draw loss and scores against the epoch."""
    if "epoch" not in history:
        return None
    numeric = [
        name for name in history.select_dtypes("number") if name != "epoch" and history[name].nunique() > 1
    ]
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
                    label=_label(name),
                )
            axis.set_title(title)
            axis.set_xlabel("epoch")
            axis.xaxis.set_major_locator(MaxNLocator(integer=True))
            axis.legend()
        return to_svg(figure, "learning", "Loss and scores of the training against the epoch")


def lines(
    key: str,
    frame: pd.DataFrame,
    x: str,
    y: str,
    series: str,
    panel: str | None = None,
    log_x: bool = False,
) -> str | None:
    """Draw medians of ``y`` against ``x``: a line per value of ``series``, a panel per value of ``panel``."""
    if not {x, y, series}.issubset(frame.columns) or (panel and panel not in frame):
        return None
    frame = frame.dropna(subset=[x, y])
    if frame.empty:
        return None
    names = list(dict.fromkeys(frame[series].astype(str)))[: len(SERIES)]
    groups = list(frame.groupby(panel, sort=True)) if panel else [("", frame)]
    groups = groups[:6]
    columns = min(len(groups), 3)
    rows = -(-len(groups) // columns)
    with style():
        figure, grid = axes(max(3.0 * columns, 5.0), 2.4 * rows + 0.5, rows=rows, columns=columns)
        cells = np.atleast_1d(grid).ravel()
        for axis, (title, part) in zip(cells, groups, strict=False):
            for number, name in enumerate(names):
                line = part[part[series].astype(str) == name].groupby(x)[y].median()
                if len(line):
                    axis.plot(
                        line.index,
                        line.to_numpy(),
                        color=SERIES[number],
                        linestyle=DASHES[number],
                        marker=MARKERS[number],
                        label=name,
                    )
            axis.set_title(str(title))
            axis.set_xlabel(_label(x))
            axis.set_ylabel(_label(y))
            if log_x:
                axis.set_xscale("log")
        for axis in cells[len(groups) :]:
            axis.set_axis_off()
        handles, labels = cells[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=min(len(labels), 4))
        return to_svg(figure, key, f"{_label(y)} against {_label(x)} by {series}")


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
