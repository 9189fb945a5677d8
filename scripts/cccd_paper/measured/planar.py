"""Corners, splines and their times, slice by slice, and what they lead to."""

from __future__ import annotations

import numpy as np
import pandas as pd

from cccd_paper.comparisons.paper_k import AUTOMATIC, CCCD
from cccd_paper.comparisons.paper_tables import nearest_images
from cccd_paper.comparisons.parameters import BEST_OF_GRID, UNTUNED
from cccd_paper.comparisons.published import TABLE_3_ORGAN
from cccd_paper.comparisons.reconstruction_comparison import DENSE, HARRIS
from cccd_paper.measured.text import Tables, markdown_table, place, written

__all__ = [
    "chain_corners",
    "chain_margin",
    "compactness",
    "corner_surfaces",
    "equal_points",
    "figure_9",
    "pixel_corners",
    "planar_times",
    "slabs",
]


#: Detectors on pixels as the page names them.
_TITLES = {"harris": "Harris", "shi_tomasi": "Shi-Tomasi", "fast": "FAST", "susan": "SUSAN"}

#: Images of a slice that detectors read, as tables name them.
_IMAGES = ("mask", "outline", "grey")


def figure_9(tables: Tables) -> pd.DataFrame:
    """FUSE2 with Figure 9's parameters in its best order and CCCD at k = 3, a row per organ."""
    rows = tables["table2_fuse"]
    fuse = rows[rows["method"].str.startswith("FUSE2") & (rows["parameters"] == "paper, Figure 9")]
    fuse = fuse[(fuse["order"] == "tour") & (fuse["image"] == "mask")].set_index("organ")
    own = rows[(rows["method"] == CCCD) & (rows["parameters"] == "k = 3")].set_index("organ")
    columns = ["dice_percent", "control_points"]
    return own[columns].join(fuse[columns], rsuffix="_fuse", how="inner")


def pixel_corners(tables: Tables) -> str:
    """Show the fused corner detectors next to CCCD, and who is ahead with the parameters of Figure 9."""
    rows = tables["table2_fuse"]
    own = (rows["method"] == CCCD) & rows["parameters"].isin(["k = 3", "k = 7", AUTOMATIC])
    fused = (rows["order"] == "tour") & (rows["parameters"] == BEST_OF_GRID)
    kept = rows[own | fused]
    organs = list(dict.fromkeys(kept["organ"]))
    shown = []
    for (method, image, parameters), group in kept.groupby(["method", "image", "parameters"], sort=False):
        cells = group.set_index("organ")
        texts = {
            organ: f"{cells.loc[organ, 'dice_percent']:.2f} / {cells.loc[organ, 'control_points']:.0f}"
            if organ in cells.index
            else "–"
            for organ in organs
        }
        name = f"{method}, {parameters if method == CCCD else image}"
        shown.append({"method: Dice % / points": name, **texts})
    both = figure_9(tables)
    ahead = both[both["dice_percent_fuse"] > both["dice_percent"]]
    fewer = int((ahead["control_points_fuse"] < ahead["control_points"]).sum())
    return "\n\n".join([
        "## Corners on pixels",
        "Tables 1 and 2 and Figure 9 of the paper: corners of an image of the slice, linked by a short tour "
        "and fused with a spline. The paper does not say which image its detectors read. Here they read the "
        "filled mask, the outline that line 10 of Algorithm 1 leaves, and the grey slice. Numbers are "
        "medians over slices of the phantom liver, as the paper's are of a liver; false corners are those "
        "off the boundary. All rows: [Dice](measured/table2_fuse.csv), [false "
        "corners](measured/table1_corners.csv), [the ten rates of Figure 11](measured/figure11_rates.csv).",
        markdown_table(_printed_parameters(tables)),
        _nearest_image(tables),
        "With the best parameters of a grid, which was searched on training phantoms for each image, next to "
        "CCCD's corners and splines on the chain code. The "
        "reference is the slice's own pixels, a staircase, so a detector that takes every other pixel as a "
        "corner is closest.",
        markdown_table(shown),
        "With the parameters that the paper prints for Figure 9, on the mask, FUSE2 has a higher Dice than "
        f"CCCD at k = 3 on {len(ahead)} of {len(both)} organs, and fewer points on {fewer} of them. The "
        "paper's claim "
        f"that CCCD misclassifies least {'does not hold' if len(ahead) else 'holds'} at these parameters. "
        "The detectors are given which of their corners lie near the boundary. CCCD's lie on it, in its "
        "order.",
    ])  # fmt: skip


def _printed_parameters(tables: Tables) -> list[dict[str, str]]:
    """Rows of the detectors at the paper's parameters: Dice and false corners on each image."""
    nearest = nearest_images(tables["table2_fuse"])
    false = tables["table1_corners"].set_index(["organ", "image", "method", "parameters"])
    shown = []
    for row in nearest.to_dict("records"):
        cells = {}
        for image in _IMAGES:
            wrong = false["false_percent"].get((TABLE_3_ORGAN, image, row["method"], row["parameters"]))
            share = "" if wrong is None else f" ({written(wrong, '.0f')} % false)"
            cells[image] = f"{written(row.get(image, np.nan))}{share}"
        paper = {"the paper": f"{row['paper_dice_percent']:.2f}"}
        name = {"method": f"{row['method']}, {row['parameters'].removeprefix('paper, ')}"}
        shown.append(name | cells | paper | {"nearest": row["nearest"]})
    return shown


def _nearest_image(tables: Tables) -> str:
    """Say which image fits most of the paper's figures, and by how much each figure is off there."""
    nearest = nearest_images(tables["table2_fuse"])
    off = {
        image: float((nearest[image] - nearest["paper_dice_percent"]).abs().median())
        for image in _IMAGES
        if image in nearest
    }
    most = nearest["nearest"].value_counts()
    counts = ", ".join(f"the {image} {most.get(image, 0)}" for image in off)
    medians = ", ".join(f"{value:.1f} on the {image}" for image, value in off.items())
    return (
        f"Of the paper's {len(nearest)} figures, the nearest image is: {counts}. The median difference from "
        f"the paper's Dice is {medians} (points)."
    )


def chain_corners(tables: Tables) -> str:
    """Show the detectors on the chain code, as published and at the best of their grids."""
    rows = tables["k_sweep"].query("criterion != 'min'")
    columns = ["DSC", "share", "too_few", "rotation", "scale", "noise"]
    medians = rows.groupby(["detector", "parameters"], sort=False)[columns].median()
    shown = [
        {
            "detector": f"{row['detector']}, {row['parameters']}",
            "Dice %": written(100 * row["DSC"], ".1f"),
            "share of the pixels, %": written(100 * row["share"], ".1f"),
            "curves with too few corners, %": written(100 * row["too_few"], ".0f"),
            "found again, %: turned, scaled, noise": ", ".join(
                written(100 * row[change], ".0f") for change in ("rotation", "scale", "noise")
            ),
        }
        for _, row in medians.reset_index().iterrows()
    ]
    dice = medians["DSC"].unstack("parameters")
    others = dice.dropna(subset=[UNTUNED])
    finest = _finest(tables)
    above = int((others[BEST_OF_GRID] > finest).sum())
    return "\n\n".join([
        "## Corners on the chain code",
        "The paper's k-cosine (maxima of curvature), and five detectors that the paper names in section 2 "
        "but does not run. Their publications could not be read, so the defaults are no claim about them. "
        "Numbers are medians over structures, compared with the pixels of their masks. A "
        "curve with fewer than four corners gets four evenly spaced points. The grid was searched on "
        "training phantoms.",
        markdown_table(shown),
        f"With their defaults here the others reach {100 * others[UNTUNED].min():.1f} to "
        f"{100 * others[UNTUNED].max():.1f} % Dice, with the best of the grid "
        f"{100 * others[BEST_OF_GRID].min():.1f} "
        f"to {100 * others[BEST_OF_GRID].max():.1f} %. {above} of {len(others)} are above the k-cosine at k "
        f"= 3 ({100 * finest:.2f} %). No best lies at an end of its grid "
        "([grids](measured/corner_grids.csv)).",
        _both_criteria(tables),
        equal_points(tables),
    ])  # fmt: skip


def _both_criteria(tables: Tables) -> str:
    """Show Figure 13: accuracy, Dice and Jaccard against k, for maxima and minima of curvature."""
    rows = tables["k_sweep"].query("detector == 'k-cosine'")
    medians = rows.groupby(["parameters", "criterion"], sort=False)[["ACC", "DSC", "JI"]].median()
    shown = []
    for name in dict.fromkeys(rows["parameters"]):
        cells = {
            f"{words}: ACC, Dice, Jaccard": ", ".join(
                f"{100 * value:.2f}" for value in medians.loc[(name, criterion)]
            )
            for criterion, words in (("max", "maxima"), ("min", "minima"))
        }
        shown.append({"k": name.removeprefix("k = "), **cells})
    return "Figure 13, in percent, both criteria:\n\n" + markdown_table(shown)


def equal_points(tables: Tables) -> str:
    """Show every detector's Dice at equal shares of the pixels, and who is ahead at each."""
    rows = tables["equal_points"]
    rows = rows.assign(name=rows["detector"].replace(_TITLES) + ", " + rows["image"])
    dice = 100 * rows.groupby(["name", "at_most"], sort=False)["DSC"].median().unstack("at_most")
    dice = dice.dropna(how="all")
    shown = [
        {"Dice % with at most": str(name)}
        | {f"{100 * share:.0f} %": written(row[share]) for share in dice.columns}
        for name, row in dice.iterrows()
    ]
    first = [f"{100 * share:.0f} %: {dice[share].idxmax()}" for share in dice.columns]
    return "\n\n".join([
        "### At equal numbers of points",
        "A Dice alone favours what marks more pixels. Here each detector may use at most a share of the "
        "outline's pixels. Its parameters are the best for that share on training phantoms; numbers are "
        "medians over the default cohort's brain, liver and lungs (five slices each; `python "
        "tests/benchmarks/corner_grids.py`, [every row](measured/equal_points.csv)). On images the corners "
        "come in their true order.",
        markdown_table(shown),
        f"The highest Dice has, at {'; at '.join(first)}.",
    ])  # fmt: skip


def _finest(tables: Tables) -> float:
    """Median Dice of the k-cosine at k = 3, maxima of curvature."""
    rows = tables["k_sweep"].query("detector == 'k-cosine' and parameters == 'k = 3' and criterion == 'max'")
    return float(np.median(rows["DSC"]))


def corner_surfaces(tables: Tables) -> str:
    """Show the paper's chain from corners to the surface."""
    rows = tables["corner_surfaces"]
    shown = [
        {
            "structure": place(row),
            "corners": row["k"] if row["k"] == AUTOMATIC else f"k = {row['k']}",
            "share of the pixels, %": written(100 * row["share"], ".1f"),
            "2D Dice %": written(100 * row["dice_2d"]),
            "3D Dice %": written(100 * row["dice_3d"]),
            "ASSD, mm": written(row["assd_mm"]),
            "kB of 200 slices": written(row["stack_bytes"] / 1000, ".0f"),
            "CPU s": written(row["seconds"], ".1f"),
        }
        for _, row in rows.iterrows()
    ]
    return "\n\n".join([
        "## From corners to the surface",
        f"The paper's chain to its end, in slabs of up to {rows['slices'].max():.0f} slices: corners are "
        "control points, and their splines are lofted. The reference is the slab's own mask, also for "
        "phantoms. The surface also gets the number of pixels within each curve (4 bytes, and counted).",
        markdown_table(shown),
    ])  # fmt: skip


def planar_times(tables: Tables) -> str:
    """Show times of corners, curves and whole ways to a surface."""
    rows = tables["table5_times"]
    medians = rows.groupby(["method", "parameters"], sort=False)[["corner_ms", "curve_ms"]].median()
    shown = [
        {
            "method": f"{row['method']}, {row['parameters']}",
            "corners, ms": written(row["corner_ms"]),
            "curve, ms": written(row["curve_ms"]),
        }
        for _, row in medians.reset_index().iterrows()
        if row["parameters"] in ("k = 3", AUTOMATIC, HARRIS, DENSE, "paper, Table 2")
    ]
    ordered = medians["curve_ms"].get((CCCD, DENSE))
    text = ""
    if ordered is not None:
        others = medians.xs(DENSE, level="parameters")["curve_ms"].drop(CCCD)
        text = (
            f"CCCD needs {ordered:.1f} ms a slice to order the pixels before it makes a curve. On the same "
            f"pixels, {int((others < ordered).sum())} of {len(others)} reconstructions are faster."
        )
    stages = [
        {
            "structure": place(row),
            "method": row["method"],
            "ms a slice": written(row["total_ms"], ".0f"),
            "of it the surface": written(row["surface_ms"], ".0f"),
            "curves closed, %": written(100 * row["closed_share"], ".0f"),
            "3D Dice": written(row["dice_3d"], ".4f"),
        }
        for _, row in tables["stage_times"].iterrows()
    ]
    return "\n\n".join([
        "## Time of corners and curves",
        "Processor time of a slice, medians over organs. The points that are linked are “Harris corners” or "
        "the “dense boundary”.",
        markdown_table(shown),
        text,
        "From the image to the surface, in slabs of a few slices. All splines go through pixel centres and "
        "are lofted there, half a pixel inside the mask, which is the reference. No method gets that half "
        "pixel.",
        markdown_table(stages),
    ])  # fmt: skip


def chain_margin(tables: Tables) -> str:
    """Say by how much the k-cosine at k = 3 is ahead of the best of the other chain-code detectors."""
    dice = tables["k_sweep"].groupby(["detector", "parameters"])["DSC"].median()
    best = dice.xs(BEST_OF_GRID, level="parameters")
    margin = 100 * (_finest(tables) - float(best.max()))
    ahead = "ahead of" if margin > 0 else "behind"
    return (
        f"On the chain code the k-cosine at k = 3 is {abs(margin):.1f} points of Dice {ahead} "
        f"{best.idxmax()} at the best of its grid ([corners](#corners-on-the-chain-code))."
    )


def slabs(tables: Tables) -> list[str]:
    """Name the slabs of a few slices on which another method's surface is nearer to the mask than ours."""
    found = []
    for (case, organ), rows in tables["stage_times"].groupby(["case", "organ"], sort=False):
        scores = rows.set_index("method")["dice_3d"].to_dict()
        ahead = {name: score for name, score in scores.items() if score > scores[CCCD]}
        if ahead:
            best = max(ahead, key=lambda name: ahead[name])
            found.append(
                f"**Slabs, {case}/{organ}.** From the image to the surface of a few slices {best} has a 3D "
                f"Dice of {ahead[best]:.3f}, ours {scores[CCCD]:.3f} "
                "([stages](#time-of-corners-and-curves))."
            )
    return found


def compactness(tables: Tables) -> str:
    """Compare the bytes of a slice's splines with those of its chain code."""
    sizes = tables["compactness"][["spline", "chain_code"]].median()
    smaller = "fewer" if sizes["chain_code"] < sizes["spline"] else "more"
    return (
        f"**Bytes of a contour.** The chain code of a slice takes {smaller} bytes "
        f"({sizes['chain_code']:.0f}) than its splines ({sizes['spline']:.0f}; medians), and keeps every "
        "pixel."
    )
