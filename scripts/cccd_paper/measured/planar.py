"""Corners, splines and their times, slice by slice, and what they lead to."""

from __future__ import annotations

import numpy as np
import pandas as pd

from cccd_paper.comparisons.paper_k import AUTOMATIC, CCCD
from cccd_paper.comparisons.parameters import BEST_OF_GRID, PUBLISHED
from cccd_paper.comparisons.reconstruction_comparison import DENSE, HARRIS
from cccd_paper.measured.text import Tables, markdown_table, place, written

__all__ = [
    "chain_corners",
    "chain_margin",
    "compactness",
    "corner_surfaces",
    "figure_9",
    "pixel_corners",
    "planar_times",
    "slabs",
]


def figure_9(tables: Tables) -> pd.DataFrame:
    """FUSE2 with Figure 9's parameters in its best order and CCCD at k = 3, a row per organ."""
    rows = tables["table2_fuse"]
    fuse = rows[rows["method"].str.startswith("FUSE2") & (rows["parameters"] == "paper, Figure 9")]
    fuse = fuse[fuse["order"] == "tour"].set_index("organ")
    own = rows[(rows["method"] == CCCD) & (rows["parameters"] == "k = 3")].set_index("organ")
    columns = ["dice_percent", "control_points"]
    return own[columns].join(fuse[columns], rsuffix="_fuse", how="inner")


def pixel_corners(tables: Tables) -> str:
    """Show the fused corner detectors next to CCCD, and who is ahead with the parameters of Figure 9."""
    rows = tables["table2_fuse"]
    own = (rows["method"] == CCCD) & rows["parameters"].isin(["k = 3", "k = 7", AUTOMATIC])
    sets = ["paper, Table 2", "paper, Figure 9", BEST_OF_GRID]
    fused = (rows["image"] == "mask") & (rows["order"] == "tour") & rows["parameters"].isin(sets)
    kept = rows[own | fused].assign(method=rows["method"] + ", " + rows["parameters"])
    organs = list(dict.fromkeys(kept["organ"]))
    shown = []
    for method, group in kept.groupby("method", sort=False):
        cells = group.set_index("organ")
        texts = {
            organ: f"{cells.loc[organ, 'dice_percent']:.2f} / {cells.loc[organ, 'control_points']:.0f}"
            for organ in organs
        }
        shown.append({"method: Dice % / points": str(method), **texts})
    both = figure_9(tables)
    ahead = both[both["dice_percent_fuse"] > both["dice_percent"]]
    fewer = int((ahead["control_points_fuse"] < ahead["control_points"]).sum())
    return "\n\n".join([
        "## Corners on pixels",
        "Tables 1 and 2 of the paper: corners of the organ's mask, linked by a short tour and fused with a "
        "spline, next to CCCD's corners and splines on the chain code. Numbers are medians over slices. The "
        "reference is the slice's own pixels, a staircase, so a detector that takes every other pixel as a "
        "corner is closest. “Best of grid” was chosen on training phantoms.",
        markdown_table(shown),
        "With the parameters that the paper prints for Figure 9, FUSE2 has a higher Dice than CCCD at k = "
        f"3 on {len(ahead)} of {len(both)} organs, and fewer points on {fewer} of them. The paper's claim "
        f"that CCCD misclassifies least {'does not hold' if len(ahead) else 'holds'} at these parameters. "
        "The detectors are given which of their corners lie near the boundary. CCCD's lie on it, in its "
        "order.",
    ])  # fmt: skip


def chain_corners(tables: Tables) -> str:
    """Show the detectors on the chain code, as published and at the best of their grids."""
    rows = tables["k_sweep"]
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
    others = dice.dropna(subset=[PUBLISHED])
    finest = _finest(tables)
    above = int((others[BEST_OF_GRID] > finest).sum())
    return "\n\n".join([
        "## Corners on the chain code",
        "The paper's k-cosine (maxima of curvature), and five detectors that the paper names in section 2 "
        "but does not run. Numbers are medians over structures, compared with the pixels of their masks. A "
        "curve with fewer than four corners gets four evenly spaced points. The grid was searched on "
        "training phantoms.",
        markdown_table(shown),
        f"With the parameters of their publications the others reach {100 * others[PUBLISHED].min():.1f} to "
        f"{100 * others[PUBLISHED].max():.1f} % Dice, with the best of the grid "
        f"{100 * others[BEST_OF_GRID].min():.1f} "
        f"to {100 * others[BEST_OF_GRID].max():.1f} %. {above} of {len(others)} are above the k-cosine at k "
        f"= 3 ({100 * finest:.1f} %).",
    ])  # fmt: skip


def _finest(tables: Tables) -> float:
    """Median Dice of the k-cosine at k = 3, maxima of curvature."""
    rows = tables["k_sweep"].query("detector == 'k-cosine' and parameters == 'k = 3'")
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
