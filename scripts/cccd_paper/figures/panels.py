"""Figures of one slice: what a comparison left, drawn panel by panel, j to the right and i downwards.

Colours are the series of the page's style; each layer also has its own mark or dash.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cccd_viewers.page_files import Panel, SliceFigure
from cccd_workflow.report.svg import INK, SERIES, style, to_svg

Looks = Mapping[str, Mapping[str, Any]]

#: How the layers are drawn where methods are compared, from back to front.
LOOKS: Looks = {
    "boundary": {"color": SERIES[0], "linewidth": 0.8},
    "seed": {"color": SERIES[3], "linestyle": "--", "linewidth": 1},
    "corners": {"color": SERIES[1], "markersize": 1.6},
    "spline": {"color": SERIES[2], "linewidth": 1.6},
}

#: Where points are linked and there is no picture behind them.
LINK_LOOKS: Looks = {
    "boundary": {"color": SERIES[0], "linewidth": 1.2},
    "links": {"color": SERIES[2], "linewidth": 1.4},
    "corners": {"color": SERIES[1], "markersize": 2.2},
}

#: And where CCCD's spline stands alone on the boundary.
OUTLINE_LOOKS: Looks = {
    "boundary": {"color": SERIES[5], "linewidth": 3.2, "alpha": 0.55},
    "spline": {"color": INK, "linewidth": 1.0},
    "corners": {"color": SERIES[1], "markersize": 2.6},
}


#: What became of a boundary map's links.
MAP_LOOKS: Looks = {
    "dropped": {"color": SERIES[1], "linewidth": 0.7},
    "kept": {"color": SERIES[0], "linewidth": 1.5},
    "bridged": {"color": INK, "linewidth": 1.5},
}


def draw_slice_figure(
    figure: SliceFigure, key: str, label: str, looks: Looks = LOOKS, panel_inches: float = 2.1
) -> str:
    """Draw every panel of a figure, as SVG.

    Parameters
    ----------
    figure : SliceFigure
    key : str
        Keeps the ids of several figures of one page apart.
    label : str
        What the figure shows, for those who cannot see it.
    looks : mapping
        How each layer is drawn; layers come in this order, one over the other.
    panel_inches : float
        Width of a panel.
    """
    columns = figure.columns or len(figure.panels)
    rows = -(-len(figure.panels) // columns)
    windows = [_window(figure, panel) for panel in figure.panels]
    tallest = max((high - low)[0] / (high - low)[1] for low, high in windows)
    tall = panel_inches * float(np.clip(tallest, 0.5, 1.6))
    with style():
        drawn = Figure(figsize=(panel_inches * columns, (tall + 0.45) * rows), layout="constrained")
        drawn.patch.set_alpha(0)
        axes = drawn.subplots(rows, columns, squeeze=False)
        for spare in axes.flat[len(figure.panels) :]:
            spare.set_axis_off()
        shown = zip(axes.flat, figure.panels, windows, strict=False)
        for number, (axis, panel, (low, high)) in enumerate(shown):
            _draw(axis, panel, looks)
            if figure.image is not None:
                extent = (low[1], high[1], high[0], low[0])
                axis.imshow(figure.image, cmap="gray", extent=extent, alpha=0.55, vmin=0, vmax=255)
            axis.set(xlim=(low[1], high[1]), ylim=(high[0], low[0]), aspect="equal", xticks=[], yticks=[])
            if panel.row and number % columns == 0:
                axis.set_ylabel(panel.row, fontsize=7)
        return to_svg(drawn, key, label)


def _window(figure: SliceFigure, panel: Panel) -> tuple[np.ndarray, np.ndarray]:
    """Edges (2,), (2,) of what a panel shows: the window's pixels, or all that is drawn."""
    if figure.window is not None:
        return figure.window[0] - 0.5, figure.window[1] + 0.5
    points = np.concatenate([part.reshape(-1, 2) for part in panel.layers.values()])
    margin = 0.05 * np.ptp(points, axis=0)
    return points.min(axis=0) - margin, points.max(axis=0) + margin


def _draw(axis: Axes, panel: Panel, looks: Looks) -> None:
    for layer, look in looks.items():
        points = panel.layers.get(layer)
        if points is None or len(points) == 0:
            continue
        if points.ndim == 3:  # links
            broken = np.full((len(points), 3, 2), np.nan)  # one path, lifted after each link
            broken[:, :2] = points
            axis.plot(broken[..., 1].ravel(), broken[..., 0].ravel(), **look)
        elif layer == "corners":
            axis.plot(points[:, 1], points[:, 0], "o", markeredgewidth=0, **look)
        else:
            closed = np.vstack([points, points[:1]])
            axis.plot(closed[:, 1], closed[:, 0], **look)
    axis.set_title("\n".join(filter(None, [panel.title, panel.detail])), fontsize=7)
    axis.grid(False)
    axis.patch.set_alpha(0)
    for spine in axis.spines.values():
        spine.set_visible(False)
