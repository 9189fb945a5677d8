"""Plots of the comparisons' tables. Each makes SVG of a data frame.

A plot whose columns are not in its table is None: the page then shows the table alone.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

from cccd_workflow.report.plots import label_of
from cccd_workflow.report.summary import structure_names
from cccd_workflow.report.svg import DASHES, INK, MARKERS, SERIES, SOFT, axes, legend_below, style, to_svg


def lines(
    key: str, frame: pd.DataFrame, x: str, measures: Mapping[str, str], series: str, dashed: str | None = None
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
            axis.set_xlabel(label_of(x))
        legend_below(figure, panels[0], len(shown) + 1)
        return to_svg(figure, key, f"{', '.join(shown.values())} against {label_of(x)}")


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
