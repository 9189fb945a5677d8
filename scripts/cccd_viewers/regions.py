"""A picture of what was read: its slices in three planes, with the outline of mask, region or labels."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from nibabel.orientations import aff2axcodes

from cccd.containers import Frame, Structure
from cccd.geometry.arrays import AnyArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


class DrawnLabels(NamedTuple):
    """Labels to be drawn in colours."""

    ranks: AnyArray  # (a, b, c) int on the structure's arrays: 0 for none, n for the n-th label
    colours: list[str]  # of each label, "#rrggbb"
    captions: list[str]  # of each label: its line of the legend


class _View(NamedTuple):
    """How a slice lies in its panel: as radiologists see it, the head or the front up."""

    axis: int  # across which it is cut
    plane: str
    across: int  # the axes along the panel's edges
    up: int
    turned_across: bool  # whether the index falls to the right
    turned_up: bool  # whether the index falls upwards
    letters: tuple[str, str, str, str]  # at the left, the right, the bottom and the top


#: Slices across the axis that runs towards one of two sides, and the letters at the left and at the top.
_PLANES = {"SI": ("axial", "R", "A"), "AP": ("coronal", "R", "S"), "LR": ("sagittal", "A", "S")}
_OPPOSITE = dict(zip("RLAPSI", "LRPAIS", strict=True))


def _views(frame: Frame) -> list[_View]:
    """Return how slices across each axis are shown, axial ones first."""
    towards = [str(letter) for letter in aff2axcodes(frame.affine)]
    views: list[_View] = []
    for pair, (plane, left, top) in _PLANES.items():
        axis = next(axis for axis, letter in enumerate(towards) if letter in pair)
        across, up = (
            next(n for n, letter in enumerate(towards) if letter in (side, _OPPOSITE[side]))
            for side in (left, top)
        )
        letters = (left, _OPPOSITE[left], _OPPOSITE[top], top)
        views.append(_View(axis, plane, across, up, towards[across] == left, towards[up] != top, letters))
    return views


def draw_region(structure: Structure, path: str | Path, labels: DrawnLabels | None = None) -> None:
    """Draw what is taken for the organ, as PNG: three slices along each axis, with letters of the directions.

    Parameters
    ----------
    structure : Structure
        With a region, a mask, boundary maps or drawn contours; and its image, where there is one.
    path : path
        Where the picture goes.
    labels : DrawnLabels, optional
        Draw these in colours, with a legend; otherwise the organ's outline.

    Raises
    ------
    ValueError
        The structure brings nothing to draw.
    """
    from matplotlib.figure import Figure

    spacing, mask = structure.frame.spacing, structure.voxels
    if structure.image is not None:
        image = structure.image
    else:
        image = np.zeros_like(mask, np.float32) if labels else mask.astype(np.float32)
    low, high = np.percentile(image, (1, 99))
    views = _views(structure.frame)
    heights = [_relative_height(mask.shape, spacing, view) for view in views]
    panels = min(_PANEL_INCHES * sum(heights), _MOST_INCHES)
    width, height = 3 * (_PANEL_INCHES + _GAP_INCHES), panels + 3 * _TITLE_INCHES + 2 * _GAP_INCHES
    columns = [] if labels is None else _columns_of(labels, height - _TITLE_INCHES)
    longest = max((len(text) for column in columns for _, text in column), default=0)
    column_width = _LETTER_INCHES * (longest + 6)
    figure = Figure(figsize=(width + column_width * len(columns), height))
    edges = {"left": _GAP_INCHES / 2, "right": width - _GAP_INCHES / 2}
    rows = {"bottom": _GAP_INCHES, "top": height - 2 * _GAP_INCHES - _TITLE_INCHES}
    grid = figure.add_gridspec(
        *(3, 3),
        **{side: inches / figure.get_figwidth() for side, inches in edges.items()},
        **{side: inches / height for side, inches in rows.items()},
        wspace=_GAP_INCHES / _PANEL_INCHES,
        hspace=3 * _TITLE_INCHES / panels,
        height_ratios=heights,
    )
    for row, view in enumerate(views):
        filled = np.flatnonzero(mask.any(axis=tuple({0, 1, 2} - {view.axis})))
        for column, share in enumerate((0.25, 0.5, 0.75)):
            panel = figure.add_subplot(grid[row, column])
            index = int(filled[int(share * (len(filled) - 1))])
            panel.imshow(
                _as_seen(image, view, index),
                cmap="gray",
                vmin=low,
                vmax=max(high, low + 1e-6),
                aspect=spacing[view.up] / spacing[view.across],
                origin="lower",
                interpolation="nearest",
            )
            if labels is None:
                panel.contour(_as_seen(mask, view, index), [0.5], colors="tab:red", linewidths=1)
            else:
                seen, opacity = _as_seen(labels.ranks, view, index), 1.0 if structure.image is None else 0.6
                _colour_labels(panel, seen, labels.colours, opacity)
            _write_letters(panel, view.letters)
            place = index + int(structure.origin[view.axis])
            panel.set_title(f"{view.plane}: axis {view.axis}, index {place}", fontsize=8, pad=3)
            panel.set_axis_off()
    title = structure.organ if structure.organ == structure.case else f"{structure.case} / {structure.organ}"
    figure.suptitle(title, x=width / 2 / figure.get_figwidth(), y=1 - _GAP_INCHES / height)
    for number, entries in enumerate(columns):
        at = (width + number * column_width + _GAP_INCHES, rows["top"])
        _write_legend(figure, entries, (at[0] / figure.get_figwidth(), at[1] / height))
    figure.savefig(path, dpi=100, format="png")


#: Sizes of the picture, inches: a panel's width, all panels' height at most, between panels, a title, a line
#: and a letter of the legend; and how many labels that has at most.
_PANEL_INCHES, _MOST_INCHES, _GAP_INCHES, _TITLE_INCHES = 2.9, 13.0, 0.12, 0.24
_LINE_INCHES, _LETTER_INCHES, _MOST_CAPTIONS = 0.175, 0.075, 200


def _columns_of(labels: DrawnLabels, height: float) -> list[list[tuple[str, str]]]:
    """Spread the legend's colours and captions evenly over as few columns of this height as hold them."""
    entries = list(zip(labels.colours, labels.captions, strict=True))
    if len(entries) > _MOST_CAPTIONS:
        left_out = len(entries) - _MOST_CAPTIONS
        entries = [*entries[:_MOST_CAPTIONS], ("none", f"... and {left_out} more")]
    count = -(-len(entries) // int(height / _LINE_INCHES))
    rows = -(-len(entries) // count)
    return [entries[first : first + rows] for first in range(0, len(entries), rows)]


def _relative_height(shape: tuple[int, ...], spacing: AnyArray, view: _View) -> float:
    """Height of a view's panels, for panels of one width; none is a mere line."""
    height = shape[view.up] * spacing[view.up] / (shape[view.across] * spacing[view.across])
    return float(np.clip(height, 0.3, 3))


def _as_seen(array: AnyArray, view: _View, index: int) -> AnyArray:
    """Take a slice as it lies in its panel: rows from the bottom up, columns to the right."""
    cut = array.take(index, view.axis)
    cut = cut.T if view.across < view.up else cut
    return cut[:: -1 if view.turned_up else 1, :: -1 if view.turned_across else 1]


def _colour_labels(panel: Axes, ranks: AnyArray, colours: Sequence[str], opacity: float) -> None:
    """Lay the labels of a slice over its image."""
    from matplotlib.colors import to_rgba_array

    colour_of_rank = to_rgba_array(["#000000", *colours])
    colour_of_rank[0, 3], colour_of_rank[1:, 3] = 0, opacity
    panel.imshow(colour_of_rank[ranks], aspect=panel.get_aspect(), origin="lower", interpolation="nearest")


def _write_letters(panel: Axes, letters: tuple[str, str, str, str]) -> None:
    """Write the directions at a panel's edges."""
    from matplotlib.patheffects import withStroke

    at = ((0.015, 0.5, "left", "center"), (0.985, 0.5, "right", "center"))
    at += ((0.5, 0.015, "center", "bottom"), (0.5, 0.985, "center", "top"))
    for letter, (x, y, side, height) in zip(letters, at, strict=True):
        panel.text(
            *(x, y, letter),
            transform=panel.transAxes,
            ha=side,
            va=height,
            color="white",
            fontsize=9,
            fontweight="bold",
            path_effects=[withStroke(linewidth=2, foreground="black")],
        )


def _write_legend(figure: Figure, entries: Sequence[tuple[str, str]], place: tuple[float, float]) -> None:
    """Write a column of colours and captions whose upper left corner is at a place of the figure."""
    from matplotlib.patches import Patch

    figure.legend(
        handles=[Patch(color=colour, label=text) for colour, text in entries],
        loc="upper left",
        bbox_to_anchor=place,
        fontsize=8,
        frameon=False,
        handlelength=1,
        handleheight=1,
        borderpad=0,
        borderaxespad=0,
        labelspacing=0.45,
    )
