"""Plots of the tables that go past the paper, and of a whole cohort. Each makes SVG of a data frame.

A plot whose columns are not in its table is None: the page then shows the table alone.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

from cccd.comparisons.summary import structure_names
from cccd.report.html_tables import words
from cccd.report.svg import DASHES, INK, MARKERS, RULE, SERIES, SOFT, axes, legend_below, style, to_svg

__all__ = ["learning_curve", "lines", "methods", "rates", "rule_times", "strips"]


def _label(name: str) -> str:
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
    measures: Mapping[str, str],
    series: str,
    dashed: str | None = None,
) -> str | None:
    """Draw medians of several measures against ``x``, one panel each.

    Parameters
    ----------
    key : str
        Id of the figure.
    frame : pandas.DataFrame
    x : str
        Column of the abscissa.
    measures : mapping of str to str
        Column and title of each panel; columns that are not there are left out.
    series : str
        Column whose values separate the lines by colour and mark; eight at most.
    dashed : str, optional
        Column whose values separate them by dash.
    """
    shown = {name: title for name, title in measures.items() if name in frame and frame[name].notna().any()}
    if not shown or not {x, series, *([dashed] if dashed else [])}.issubset(frame.columns):
        return None
    names = list(dict.fromkeys(frame[series].astype(str)))[: len(SERIES)]
    styles = list(dict.fromkeys(frame[dashed].astype(str))) if dashed else [""]
    with style():
        figure, grid = axes(max(2.9 * len(shown), 4.6), 3.1, columns=len(shown))
        panels = np.atleast_1d(grid)
        for axis, (measure, title) in zip(panels, shown.items(), strict=True):
            for number, name in enumerate(names):
                for pattern, kind in enumerate(styles):
                    part = frame[frame[series].astype(str) == name]
                    part = part[part[dashed].astype(str) == kind] if dashed else part
                    line = part.groupby(x)[measure].median().dropna()
                    axis.plot(
                        line.index,
                        line.to_numpy(),
                        color=SERIES[number],
                        linestyle=DASHES[pattern if dashed else number],
                        marker=MARKERS[number],
                        label=f"{name}, {kind}" if kind else name,
                    )
            axis.set_title(title)
            axis.set_xlabel(_label(x))
        legend_below(figure, panels[0], len(shown) + 1)
        return to_svg(figure, key, f"{', '.join(shown.values())} against {_label(x)}")


def methods(
    key: str,
    frame: pd.DataFrame,
    method: str,
    measures: Mapping[str, str],
    logarithmic: Collection[str] = (),
    group: str | None = None,
    ours: str = "CCCD",
) -> str | None:
    """Draw a dot per method and structure (or ``group``), one panel per measure; our row is lettered in ink.

    Parameters
    ----------
    key : str
        Id of the figure.
    frame : pandas.DataFrame
        One row per method and structure.
    method : str
        Column that names the rows of dots.
    measures : mapping of str to str
        Column and title of each panel; columns that are not there are left out.
    logarithmic : collection of str
        Measures on a logarithmic axis.
    group : str, optional
        Column that colours the dots; the structure by default.
    ours : str
        What the name of our own method holds.
    """
    shown = {name: title for name, title in measures.items() if name in frame and frame[name].notna().any()}
    if not shown or method not in frame:
        return None
    rows = list(dict.fromkeys(frame[method].astype(str)))
    colours = structure_names(frame) if group is None else frame[group].astype(str)
    names = list(dict.fromkeys(colours))
    with style():
        figure, grid = axes(
            2.1 + 1.7 * len(shown), 0.95 + 0.27 * max(1.0, len(names) / 4) * len(rows), columns=len(shown)
        )
        panels = np.atleast_1d(grid)
        for axis, (measure, title) in zip(panels, shown.items(), strict=True):
            for number, name in enumerate(names):
                part = frame[colours == name]
                place = part[method].astype(str).map(rows.index)
                axis.plot(
                    part[measure],
                    place + (number - (len(names) - 1) / 2) * min(0.14, 0.7 / len(names)),
                    color=SERIES[number % len(SERIES)],
                    marker=MARKERS[(number + number // len(SERIES)) % len(MARKERS)],
                    linestyle="none",
                    label=name,
                )
            axis.set_title(title)
            axis.set_ylim(len(rows) - 0.4, -0.6)
            axis.set_yticks(range(len(rows)), rows if axis is panels[0] else [])
            _scale(axis, frame[measure], measure in logarithmic)
        for tick, row in zip(panels[0].get_yticklabels(), rows, strict=True):
            tick.set_color(INK if ours in row else SOFT)
        if len(names) > 1:
            legend_below(figure, panels[0], 4)
        return to_svg(figure, key, f"{', '.join(shown.values())} of {len(rows)} methods")


def _scale(axis: Axes, values: pd.Series, logarithmic: bool) -> None:
    """Set the abscissa's scale and ticks for these values; logarithmic only where all are positive."""
    if not logarithmic or values.min() <= 0:
        axis.xaxis.set_major_locator(MaxNLocator(3))
        return
    axis.set_xscale("log")
    if values.max() < 100 * values.min():  # few powers of ten: name what is between
        axis.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.xaxis.set_minor_formatter(NullFormatter())


def rates(key: str, medians: pd.DataFrame, label: str) -> str:
    """Draw shares between 0 and 1: a row per rate, a mark per method.

    Parameters
    ----------
    key : str
        Id of the figure.
    medians : pandas.DataFrame
        One row per method, one column per rate.
    label : str
        What the figure shows, for those who cannot see it.
    """
    rows = list(medians.columns)
    spread = np.linspace(-0.3, 0.3, len(medians))
    with style():
        figure, axis = axes(7.2, 0.62 + 0.26 * len(rows))
        for number, (method, values) in enumerate(medians.iterrows()):
            axis.plot(
                values.to_numpy(),
                np.arange(len(rows)) + spread[number],
                linestyle="none",
                marker=MARKERS[number % len(MARKERS)],
                color=SERIES[number % len(SERIES)],
                markersize=4,
                label=method,
            )
        axis.set(yticks=range(len(rows)), yticklabels=rows, ylim=(len(rows) - 0.5, -0.5), xlim=(-0.02, 1.02))
        axis.set_xlabel("share")
        axis.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
        return to_svg(figure, key, label)


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
