"""What the page draws for each item of the registry, out of the files that the comparisons left.

Every function takes the run's `Results` and the `Item`, and returns pairs of SVG and caption; a plot whose
data are not there is left out.
"""

from __future__ import annotations

from dataclasses import replace

import pandas as pd

from cccd.geometry.arrays import split_ragged
from cccd_paper.comparisons.cohort_tables import at_best, figure_11_rows
from cccd_paper.comparisons.paper_k import CCCD, COARSE_K
from cccd_paper.comparisons.reconstruction_comparison import DENSE
from cccd_paper.figures import plots
from cccd_paper.figures.diagrams import draw_steps
from cccd_paper.figures.panels import LINK_LOOKS, LOOKS, MAP_LOOKS, OUTLINE_LOOKS, Looks, draw_slice_figure
from cccd_paper.figures.stills import draw_surface_still
from cccd_viewers.page_files import Panel, SliceFigure
from cccd_workflow.report.registry import Item
from cccd_workflow.report.results import Results
from cccd_workflow.report.summary import structure_names

#: Pairs of SVG (None: no data) and caption.
Plots = list[tuple[str | None, str]]

#: Plots of single structures are drawn of so many; the table has them all.
_MOST_PANELS = 6

#: Figure 12 shows so many structures.
_MOST_OUTLINES = 4

#: Figure 7 shows so many training graphs.
_MOST_GRAPHS = 8

#: Figure 5, the paper's network as printed, and Figure 8, Algorithm 1 with its lines.
_NETWORK = (
    "boundary pixels,\n8 neighbours each",
    "features x:\n+1 and −1",
    "dense:\nx W + b",
    "batch\nnormalisation",
    "dropout 0.5",
    "PReLU",
    "sum over the\nneighbours, eq. (11)",
    "a value per link\n(how: invented)",
    "at most two links\nper pixel",
    "chains followed:\nclosed curves",
)
_ALGORITHM = (
    "volume, slice\nby slice (line 7)",
    "Gaussian blur,\ndilation (line 9)",
    "boundary\n(line 10)",
    "chain code\n(line 13)",
    "isolated corners?\n(line 14)",
    "network drops\nlinks (line 15)",
    "k-cosine corners\n(line 16)",
    "closed B-spline\n(line 17)",
    "curves\nstacked",
    "B-spline surface\n(line 22)",
)

_RATES = ["TP rate", "FP rate", "TN rate", "FN rate", "ACC", "MC", "PRE", "SPEC", "DSC", "JI"]


def _on_a_slice(
    results: Results, item: Item, looks: Looks = LOOKS, panel_inches: float = 2.1, key: str | None = None
) -> Plots:
    """Draw the slice figure of the structure that is shown; its caption is the item's first."""
    chosen = results.shown(item)
    if chosen is None:
        return []
    case, organ, figure = chosen
    caption = item.captions[0]
    svg = draw_slice_figure(figure, key or item.key, caption, looks, panel_inches)
    return [(svg, f"{case} / {organ}, middle slice. {caption}")]


def _of_structures(results: Results, item: Item, looks: Looks = LOOKS, panel_inches: float = 2.1) -> Plots:
    """Draw the slice figures of the first structures that have one."""
    drawn: Plots = []
    for case, organ in results.structures:
        figure = results.figure(item, case, organ)
        if figure is not None and len(drawn) < _MOST_PANELS:
            caption = f"{case} / {organ}: {item.captions[0]}"
            svg = draw_slice_figure(figure, f"{item.key}-{case}-{organ}", caption, looks, panel_inches)
            drawn.append((svg, caption))
    return drawn


def figure_5(results: Results, item: Item) -> Plots:
    """Draw the paper's network, step by step."""
    return [(draw_steps(item.key, _NETWORK, item.captions[0]), item.captions[0])]


def figure_8(results: Results, item: Item) -> Plots:
    """Draw Algorithm 1, step by step."""
    return [(draw_steps(item.key, _ALGORITHM, item.captions[0]), item.captions[0])]


def figure_6(results: Results, item: Item) -> Plots:
    """Draw the middle slice of the first structures as it came, and its boundary."""
    return _of_structures(results, item)[:_MOST_OUTLINES]


def figure_7(results: Results, item: Item) -> Plots:
    """Draw the first training graphs: their pixels over the true contours."""
    kept, facts = results.training_graphs(), results.graphs()
    if kept is None or facts is None:
        return []
    pixels = split_ragged(kept.pixels, kept.pixel_offsets)
    contours = split_ragged(kept.contours, kept.contour_offsets)
    panels = []
    for n in range(min(_MOST_GRAPHS, len(pixels))):
        longest = max((contours[c] for c in (kept.contour_graph == n).nonzero()[0]), key=len)
        panels.append(Panel(f"{len(pixels[n])} pixels", {"boundary": longest, "corners": pixels[n]}))
    svg = draw_slice_figure(SliceFigure(panels, 4), item.key, item.captions[0], OUTLINE_LOOKS, 1.7)
    return [(svg, item.captions[0])]


def figure_9(results: Results, item: Item) -> Plots:
    """Draw corners and fused splines over the boundary."""
    return _on_a_slice(results, item)


def figure_14(results: Results, item: Item) -> Plots:
    """Draw CCCD's outlines for three k and, where there is one, a segmentation network's."""
    chosen = results.shown(item)
    if chosen is None:
        return []
    case, organ, figure = chosen
    network = results.files(case, organ).figure("segmenters", item.key)
    panels = [*figure.panels, *(network.panels if network else [])]
    lettered = [
        replace(panel, title=f"({letter}) {panel.title}")
        for letter, panel in zip("abcd", panels, strict=False)
    ]
    caption = item.captions[0]
    svg = draw_slice_figure(SliceFigure(lettered), item.key, caption, OUTLINE_LOOKS, 2.0)
    return [(svg, f"{case} / {organ}, middle slice. {caption}")]


def figure_10(results: Results, item: Item) -> Plots:
    """Draw CCCD's outlines for four k, and Dice and points against k."""
    drawn = _on_a_slice(results, item, OUTLINE_LOOKS, 2.3, key="figure10-outlines")
    sweep = _sweep(results, item)
    if sweep is None:
        return drawn
    maxima = sweep[sweep["criterion"].str.startswith("max")]
    shown = {"DSC": "Dice", "share": "Corners / boundary pixels"}
    return [*drawn, (plots.lines(item.key, maxima, "k", shown, "structure"), item.captions[1])]


def figure_12(results: Results, item: Item) -> Plots:
    """Draw the coarse outline of several structures side by side, and its Dice."""
    panels = []
    for case, organ in results.structures[:_MOST_OUTLINES]:
        figure = results.figure(item, case, organ)
        if figure is not None:
            panels += [replace(panel, title=f"{case} / {organ}") for panel in figure.panels]
    label, caption = item.captions
    outlines = SliceFigure(panels)
    drawn: Plots = []
    if panels:
        drawn = [(draw_slice_figure(outlines, "figure12-outlines", label, OUTLINE_LOOKS, 2.3), label)]
    sweep = _sweep(results, item)
    if sweep is None:
        return drawn
    coarse = sweep[sweep["k"] == COARSE_K]
    dice = {"DSC": f"Dice at k = {COARSE_K}"}
    return [*drawn, (plots.methods(item.key, coarse, "structure", dice, group="criterion"), caption)]


def _sweep(results: Results, item: Item) -> pd.DataFrame | None:
    sweep = results.rows(item.rows[0])
    if sweep is None:
        return None
    return sweep[sweep["k"].notna()].assign(structure=structure_names(sweep))


def figure_11(results: Results, item: Item) -> Plots:
    """Draw ten rates, medians over slices, of the fused detectors and of CCCD for each k."""
    rows = results.rows(item.rows[0])
    if rows is None:
        return []
    medians = figure_11_rows(rows).groupby("method", sort=False)[_RATES].median()
    return [
        (plots.rates(item.key, medians, "Ten rates of the fused detectors and of CCCD"), item.captions[0])
    ]


def figure_13(results: Results, item: Item) -> Plots:
    """Draw three scores against k."""
    sweep = _sweep(results, item)
    if sweep is None:
        return []
    shown = {"ACC": "Accuracy", "DSC": "Dice", "JI": "Jaccard"}
    return [(plots.lines(item.key, sweep, "k", shown, "structure", dashed="criterion"), item.captions[0])]


def figure_15(results: Results, item: Item) -> Plots:
    """Draw the snakes of five seeds, and Dice against the seed's radius and place."""
    drawn = _on_a_slice(results, item)
    rows = results.rows(item.rows[0])
    if rows is None:
        return drawn
    grid = rows[rows["setting"] == "grid"]
    wide = grid.pivot_table(index=["radius", "offset"], columns="method", values="dice", aggfunc="median")
    wide = wide.reset_index().rename_axis(columns=None).rename(columns={"radius": "seed radius"})
    wide["seed"] = wide["offset"].map(lambda offset: f"seed {offset:g} radii off centre")
    shown = {name: name for name in grid["method"].unique()}
    return [*drawn, (plots.lines("figure15-lines", wide, "seed radius", shown, "seed"), item.captions[1])]


def figure_16(results: Results, item: Item) -> Plots:
    """Draw the links that each method makes, and how often they close."""
    drawn = _on_a_slice(results, item, LINK_LOOKS)
    rows = results.rows(item.rows[0])
    if rows is None:
        return drawn
    method = rows["method"].where(rows["method"] != CCCD, CCCD + ", given " + rows["given"])
    rows = rows.assign(closed=rows["closed"].astype(float), method=method)
    means = rows.groupby(["points", "method"], sort=False)[["closed", "dice"]].mean().reset_index()
    shown = {"closed": "One curve", "dice": "Mean Dice"}
    dots = plots.methods("figure16-dots", means, "method", shown, group="points")
    return [*drawn, (dots, item.captions[1])]


def table_5(results: Results, item: Item) -> Plots:
    """Draw the times of every detector and reconstruction."""
    rows = results.table("table5_times")
    if rows is None:
        return []
    told_apart = rows["parameters"].isin(["automatic", DENSE])
    rows = rows.assign(method=rows["method"].mask(told_apart, rows["method"] + ", " + rows["parameters"]))
    shown = {"corner_ms": "Corners (ms)", "curve_ms": "Curve (ms)"}
    return [(plots.methods(item.key, rows, "method", shown, logarithmic=shown), item.captions[0])]


def surfaces(results: Results, item: Item) -> Plots:
    """Draw the baselines' surfaces beside ours."""
    rows = results.table("surfaces")
    if rows is None:
        return []
    if "chosen" in rows:
        rows = rows.assign(method=rows["method"] + (", " + rows["chosen"].astype(object)).fillna(""))
    shown = {
        "dice_3d": "3D Dice",
        "assd_mm": "ASSD (mm)",
        "volume_bias": "Volume bias",
        "bending_per_area_mm2": "Bending / area",
        "bytes": "Bytes",
    }
    logarithmic = ("bytes", "bending_per_area_mm2")
    return [(plots.methods(item.key, rows, "method", shown, logarithmic), item.captions[0])]


def thick_slices(results: Results, item: Item) -> Plots:
    """Draw error, roughness and bias against the distance of the slices that were kept."""
    rows = results.table("thick_slices")
    if rows is None:
        return []
    rows = at_best(rows)
    shown = {"assd_mm": "ASSD (mm)", "volume_bias": "Volume bias", "bending_per_area_mm2": "Bending / area"}
    drawn: Plots = [
        (
            plots.lines(f"thick-{name}", part, "slice_distance_mm", shown, "method"),
            f"{name}: {item.captions[0]}",
        )
        for name, part in rows.groupby(structure_names(rows), sort=False)
    ]
    return [pair for pair in drawn if pair[0] is not None][:_MOST_PANELS]


def junctions(results: Results, item: Item) -> Plots:
    """Draw the share of correct curves per kind of corruption, decoder by decoder."""
    rows = results.table("junctions")
    if rows is None:
        return []
    shown = {"correct": "Correct", "dice": "Mean Dice"}
    return [(plots.methods(item.key, rows, "kind", shown, group="decoder", ours="all"), item.captions[0])]


def map_surfaces(results: Results, item: Item) -> Plots:
    """Draw what became of the links of every structure that came as boundary maps."""
    return _of_structures(results, item, MAP_LOOKS)


def algorithm_1(results: Results, item: Item) -> Plots:
    """Draw the paper's surface and ours, cut across the slices."""
    return _of_structures(results, item, OUTLINE_LOOKS, 3.0)


def compactness(results: Results, item: Item) -> Plots:
    """Draw bytes per slice of every way to keep the contours."""
    sizes = results.table("compactness")
    if sizes is None:
        return []
    long = sizes.melt(["case", "organ"], var_name="representation", value_name="bytes")
    long["representation"] = long["representation"].str.replace("_", " ")
    shown = {"bytes": "Bytes per slice (median)"}
    svg = plots.methods(item.key, long, "representation", shown, logarithmic=shown, ours="spline")
    return [(svg, item.captions[0])]


def figure_17(results: Results, item: Item) -> Plots:
    """Draw marching cubes, our surface and its control net."""
    livers_first = sorted(results.structures, key=lambda key: key[1] != "liver")
    for case, organ in livers_first:
        svg = draw_surface_still(item.key, results.files(case, organ))
        if svg is not None:
            return [(svg, f"{case} / {organ}, {item.captions[0]}")]
    return []
