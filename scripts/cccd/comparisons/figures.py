"""Figures 9, 11, 15 and 16 with our runs, as matplotlib figures.

Colours come from the property cycle and the text colours of the style they are drawn in, so a report
can give them its own; each series also has its own mark or dash. Slices are drawn with j to the right
and i downwards.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from cccd.comparisons.active_contour import seed_circle
from cccd.comparisons.active_contour_comparison import seed_of, snake, snake_corners
from cccd.comparisons.corner_comparison import CCCD, fused_spline
from cccd.comparisons.fuse import near_boundary
from cccd.comparisons.links import count_links
from cccd.comparisons.parameters import parameter_sets
from cccd.comparisons.reconstruction_comparison import HARRIS, link_along_chain, point_sets
from cccd.comparisons.registry import CONTOURS, CORNER_DETECTORS, RECONSTRUCTIONS, reconstruct
from cccd.comparisons.samples import SliceSample, choose_slices
from cccd.containers import Curves, Structure
from cccd.metrics import dice, rasterise_slice

__all__ = ["figure_9", "figure_11", "figure_15", "figure_16"]

MARKERS = "os^DvPX"

#: CCCD's settings in the paper's Figure 11; with the three fused methods they make seven series.
FIGURE_11 = ["k = 3", "k = 5", "k = 7", "k = 20"]

#: Methods of the paper's Figure 16, then the strongest of the others.
FIGURE_16 = ("connect2d", "crawl", "nn_crust", "tour")


def _middle_sample(structure: Structure, curves: Curves, settings: Mapping) -> SliceSample | None:
    """Take the slice a figure shows: the middle one of those compared."""
    samples = choose_slices(structure, curves, settings["n_slices"], settings["min_contour_px"])
    return samples[len(samples) // 2] if samples else None


def _panels(rows: int, columns: int, extent: np.ndarray) -> tuple[Figure, np.ndarray]:
    """Make panels with the proportions of what they show, (i, j)."""
    height = 2.1 * np.clip(extent[0] / extent[1], 0.5, 1.6)
    figure = Figure(figsize=(2.1 * columns, (height + 0.45) * rows), layout="constrained")
    figure.patch.set_alpha(0)
    return figure, figure.subplots(rows, columns, squeeze=False)


def _background(axis: Axes, sample: SliceSample, image: str) -> None:
    """Show an image of the slice."""
    low, high = sample.origin - 0.5, sample.origin + sample.region.shape - 0.5
    extent = (low[1], high[1], high[0], low[0])
    axis.imshow(sample.images[image], cmap="gray", extent=extent, alpha=0.55, vmin=0, vmax=255)
    _frame(axis, low, high)


def _frame(axis: Axes, low: np.ndarray, high: np.ndarray) -> None:
    """Bound the picture and leave out what does not belong to it."""
    axis.set(xlim=(low[1], high[1]), ylim=(high[0], low[0]), aspect="equal", xticks=[], yticks=[])
    axis.grid(False)
    for spine in axis.spines.values():
        spine.set_visible(False)


def _line(axis: Axes, curve: np.ndarray, color: str, **style) -> None:
    closed = np.vstack([curve, curve[:1]]) if len(curve) else curve
    axis.plot(closed[:, 1], closed[:, 0], color=color, **style)


def _dots(axis: Axes, points: np.ndarray, color: str, size: float = 1.6, **style) -> None:
    axis.plot(points[:, 1], points[:, 0], "o", color=color, markersize=size, markeredgewidth=0, **style)


def _dice_percent(sample: SliceSample, curve: np.ndarray) -> float:
    polygons = [curve] if len(curve) else []
    return 100 * float(dice(sample.region, rasterise_slice(polygons, sample.origin, sample.region.shape)))


def figure_9(structure: Structure, curves: Curves, settings: Mapping, seed: int) -> Figure | None:
    """Draw corners (dots) and fused splines (thick) over the boundary (thin), one column per detector.

    The upper row has the paper's parameters of Figure 9 (the publication's for SUSAN), the lower row the
    best of the grid; corners are ordered by a short tour, which is what corners alone allow.

    Parameters
    ----------
    structure : Structure
    curves : Curves
    settings : mapping
        The configuration's ``comparisons``.
    seed : int
        Unused here; all figures of a structure are called alike.

    Returns
    -------
    Figure or None
        None when there is no curve to show.
    """
    sample = _middle_sample(structure, curves, settings["corners"])
    if sample is None:
        return None
    image = "grey" if "grey" in sample.images else "mask"
    figure, axes = _panels(2, len(CORNER_DETECTORS), sample.region.shape)
    for column, (name, method) in enumerate(CORNER_DETECTORS.items()):
        first, *_, best = parameter_sets(name, image).items()
        for axis, (label, parameters) in zip(axes[:, column], (first, best), strict=True):
            found = method.run(sample.images[image], **parameters) + sample.origin
            used = found[near_boundary(found, sample.curve, settings["corners"]["on_boundary_px"])].astype(
                float
            )
            spline = fused_spline(used, "tour", sample.curve)
            _background(axis, sample, image)
            _line(axis, sample.curve, "C0", linewidth=0.8)
            _dots(axis, found, "C1")
            _line(axis, spline, "C2", linewidth=1.6)
            score = _dice_percent(sample, spline)
            axis.set_title(
                f"{method.title}\n{label}\nDice {score:.1f} %, {len(used)} of {len(found)}", fontsize=7
            )
    return figure


def figure_11(corners: pd.DataFrame) -> Figure:
    """Plot ten rates (median over slices) of the fused detectors and of CCCD for each k.

    Parameters
    ----------
    corners : DataFrame
        Rows of `compare_corners` of one or more structures; detectors with the paper's Table 2
        parameters on the organ's mask, corners along a short tour.
    """
    rates = ["TP rate", "FP rate", "TN rate", "FN rate", "ACC", "MC", "PRE", "SPEC", "DSC", "JI"]
    fused = (corners["order"] == "tour") & (corners["image"] == "mask")
    fused = corners[fused & (corners["parameters"] == "paper, Table 2")]
    own = corners[(corners["detector"] == "cccd") & corners["parameters"].isin(FIGURE_11)]
    own = own.assign(method="CCCD, " + own["parameters"])
    medians = pd.concat([fused, own]).groupby("method", sort=False)[rates].median()
    figure = Figure(figsize=(7.2, 0.62 + 0.26 * len(rates)), layout="constrained")
    figure.patch.set_alpha(0)
    axis = figure.subplots()
    axis.patch.set_alpha(0)
    spread = np.linspace(-0.3, 0.3, len(medians))
    for number, (method, row) in enumerate(medians.iterrows()):
        axis.plot(
            row.to_numpy(),
            np.arange(len(rates)) + spread[number],
            linestyle="none",
            marker=MARKERS[number],
            color=f"C{number}",
            markersize=4,
            label=method,
        )
    axis.set(yticks=range(len(rates)), yticklabels=rates, ylim=(len(rates) - 0.5, -0.5), xlim=(-0.02, 1.02))
    axis.set_xlabel("share")
    axis.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def figure_15(structure: Structure, curves: Curves, settings: Mapping, seed: int) -> Figure | None:
    """Draw the snake's seed (dashed), its targets (dots), its end (thick) and the boundary (thin).

    One column per setting; the upper row is the snake on corners, as in the paper, the lower row the
    snake on the grey image where there is one. Parameters as in `figure_9`; ``seed`` gives the
    direction in which seeds are moved.
    """
    section = settings["active_contour"]
    sample = _middle_sample(structure, curves, section)
    if sample is None:
        return None
    angle = float(np.random.default_rng(seed).uniform(0, 2 * np.pi))
    names = [name for name in CONTOURS if name in {"corners", *sample.images}]
    figure, axes = _panels(len(names), len(section["figure_15"]), sample.region.shape)
    for row, name in zip(axes, names, strict=True):
        for axis, (letter, (radius, offset)) in zip(row, section["figure_15"].items(), strict=True):
            curve = snake(sample, name, radius, offset, angle)
            _background(axis, sample, "grey" if "grey" in sample.images else "mask")
            _line(axis, sample.curve, "C0", linewidth=0.8)
            _line(
                axis,
                seed_circle(*seed_of(sample, radius, offset, angle), 90),
                "C3",
                linestyle="--",
                linewidth=1,
            )
            if name == "corners":
                _dots(axis, snake_corners(sample), "C1")
            _line(axis, curve, "C2", linewidth=1.6)
            axis.set_title(
                f"{letter}: radius {radius:g}, offset {offset:g}\nDice {_dice_percent(sample, curve):.1f} %",
                fontsize=7,
            )
        row[0].set_ylabel(CONTOURS[name].title, fontsize=7)
    return figure


def figure_16(structure: Structure, curves: Curves, settings: Mapping, seed: int) -> Figure | None:
    """Draw what reconstruction makes of Harris corners: ground truth, the paper's three, a tour, CCCD.

    Parameters as in `figure_9`. None also when the slice has fewer than three Harris corners.
    """
    section = settings["reconstruction"]
    sample = _middle_sample(structure, curves, section)
    if sample is None:
        return None
    sets = point_sets(sample, section["every"], section["jitter_px"], np.random.default_rng(seed))
    if HARRIS not in sets:
        return None
    points = sets[HARRIS]
    linked = {RECONSTRUCTIONS[key].title: reconstruct(key, points) for key in FIGURE_16}
    linked[CCCD] = link_along_chain(points, sample.curve)
    low, high = sample.curve.min(0) - 4, sample.curve.max(0) + 4
    figure, axes = _panels(2, 3, high - low)
    _frame(axes.flat[0], low, high)
    _line(axes.flat[0], sample.curve, "C0", linewidth=1.2)
    axes.flat[0].set_title("Ground truth", fontsize=7)
    for axis, (title, links) in zip(axes.flat[1:], linked.items(), strict=True):
        counts = count_links(links, len(points))
        segments = LineCollection(points[links][:, :, ::-1], colors="C2", linewidths=1.4)
        _frame(axis, low, high)
        axis.add_collection(segments)
        _dots(axis, points, "C1", 2.2)
        gaps = "closed" if counts.closed else f"{counts.open_ends} open ends, {counts.junctions} junctions"
        axis.set_title(f"{title}\n{counts.connected} connected, {gaps}", fontsize=7)
    return figure
