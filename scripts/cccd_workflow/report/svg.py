"""Figures as inline SVG: real text, the page's fonts, colours that follow its light or dark scheme.

matplotlib writes fixed colours. Figures are drawn with a few marker colours, which are then replaced by the
page's CSS variables.
"""

from __future__ import annotations

import base64
import contextlib
import io
import re
from collections.abc import Iterator
from typing import Any
from xml.sax.saxutils import escape

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.rcsetup import cycler
from PIL import Image

from cccd_workflow.report.render import webp

#: Marker colours and the variables that replace them.
INK, SOFT, RULE = "#010203", "#010204", "#010205"

#: Series colours: Okabe and Ito's, distinct with any colour vision; each also has its own mark and dash.
SERIES = ["#010210", "#010211", "#010212", "#010213", "#010214", "#010215", "#010216", "#010217"]
MARKERS = ["o", "s", "^", "D", "v", "P", "X", "*"]
DASHES = ["-", "--", "-.", ":", (0, (5, 1)), (0, (3, 1, 1, 1)), (0, (1, 1)), (0, (7, 2))]

#: A figure never shrinks below this width in CSS pixels; on a narrow screen it is scrolled instead.
_READABLE_PX = 560

#: More marks than this are drawn as pixels: each mark of an SVG is an element that the browser keeps.
_MOST_MARKS = 400

#: Resolution of what is drawn as pixels.
_PIXELS_PER_INCH = 160

#: The series colours as pixels, which cannot follow the scheme: Okabe and Ito's own.
_PIXEL_COLOURS = dict(
    zip(
        SERIES,
        ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#888888", "#9b7fd0"],
        strict=True,
    )
)

_VARIABLES = {INK: "--ink", SOFT: "--soft", RULE: "--rule"} | {
    colour: f"--series-{number}" for number, colour in enumerate(SERIES)
}

_SETTINGS: dict[Any, Any] = {
    "svg.fonttype": "none",
    "font.family": "sans-serif",
    "font.size": 9,
    "axes.edgecolor": RULE,
    "axes.labelcolor": SOFT,
    "axes.titlecolor": INK,
    "axes.titlesize": 9.5,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.linewidth": 0.8,
    "grid.color": RULE,
    "grid.linewidth": 0.6,
    "xtick.color": RULE,
    "ytick.color": RULE,
    "xtick.labelcolor": SOFT,
    "ytick.labelcolor": SOFT,
    "text.color": INK,
    "legend.frameon": False,
    "legend.labelcolor": INK,
    "legend.fontsize": 8.5,
    "lines.linewidth": 1.5,
    "lines.markersize": 4.5,
    "figure.constrained_layout.use": True,
    "axes.prop_cycle": cycler(color=SERIES),
}


@contextlib.contextmanager
def style() -> Iterator[None]:
    """Draw within this block to get the page's look."""
    with matplotlib.rc_context(_SETTINGS):
        yield


def axes(width: float = 6.0, height: float = 3.2, rows: int = 1, columns: int = 1):
    """Make a figure (inches) and its axes, as `Figure.subplots` gives them; call within `style`."""
    figure = Figure(figsize=(width, height))
    figure.patch.set_alpha(0)
    grid = figure.subplots(rows, columns)
    for one in [grid] if rows * columns == 1 else grid.ravel():
        one.patch.set_alpha(0)
    return figure, grid


def legend_below(figure: Figure, panel: Axes, most: int) -> None:
    """Name the series of ``panel`` below the figure, in at most ``most`` columns and no wider than it."""
    handles, labels = panel.get_legend_handles_labels()
    for columns in range(min(len(labels), most), 0, -1):
        legend = figure.legend(handles, labels, loc="outside lower center", ncols=columns)
        if columns == 1 or legend.get_window_extent().width <= figure.bbox.width:
            return
        legend.remove()


def to_svg(figure: Figure, key: str, label: str) -> str:
    """Write the figure as an ``<svg>`` element.

    Parameters
    ----------
    figure : Figure
    key : str
        Keeps the ids of several figures of one page apart.
    label : str
        What the figure shows, for those who cannot see it.
    """
    with matplotlib.rc_context({**_SETTINGS, "svg.hashsalt": key}):
        for line in figure.findobj(Line2D):
            if (
                line.get_marker() not in (None, "None", "none", "")
                and np.size(line.get_xdata()) > _MOST_MARKS
            ):
                marker = to_hex(line.get_color())
                colour = _PIXEL_COLOURS.get(marker, marker)
                line.set(rasterized=True, color=colour, markerfacecolor=colour)
        buffer = io.StringIO()
        figure.set_dpi(_PIXELS_PER_INCH)
        FigureCanvasSVG(figure).print_svg(buffer, metadata={"Date": None, "Creator": None})
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    for colour, variable in _VARIABLES.items():
        text = text.replace(colour, f"var({variable})")
    text = re.sub(r"data:image/png;base64,([^\"]*)", lambda found: _as_webp(found[1]), text)
    # Attributes cannot hold variables, style declarations can; fonts are the page's.
    text = re.sub(r'(fill|stroke)="(var\([^)]*\))"', r'style="\1: \2"', text)
    text = re.sub(r"font-family: [^;\"]*", "font-family: var(--sans)", text)
    # A style sheet within an SVG would hold for the whole page, and groups of all figures share their ids.
    text = re.sub(r"<style[^>]*>.*?</style>", "", text, flags=re.DOTALL)
    text = re.sub(r'<g id="[^"]*"', "<g", text)
    head, rest = text.split(">", 1)
    view = head.split('viewBox="')[1].split('"')[0]
    title = "<title>" + escape(label, {'"': "&quot;"}) + "</title>"
    width = float(view.split()[2]) * 4 / 3  # points to CSS pixels
    size = f"min-width: {min(width, _READABLE_PX):.0f}px; max-width: {width:.0f}px"
    return f'<svg viewBox="{view}" role="img" class="plot" style="{size}">{title}{rest}'


def _as_webp(png: str) -> str:
    """Encode a picture within a figure again."""
    with Image.open(io.BytesIO(base64.b64decode(png))) as picture:
        return f"data:image/webp;base64,{webp(picture, 75)}"
