"""The paper's Tables 1-5 with our numbers beside the paper's.

Everything is computed from the rows that the comparisons left for each structure, so the same tables
come out for any cohort. Counts, scores and times are medians over an organ's slices; columns that begin
with ``paper_`` are the paper's.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from cccd_paper.comparisons import published
from cccd_paper.comparisons.baselines.reconstructions import RECONSTRUCTIONS
from cccd_paper.comparisons.paper_k import CCCD
from cccd_paper.comparisons.parameters import UNTUNED
from cccd_paper.comparisons.reconstruction_comparison import DENSE, HARRIS, POINTS
from cccd_workflow.report.summary import Cohort

#: Equations (12) to (21) under the names of Figure 11.
RATES = ("TP rate", "FP rate", "TN rate", "FN rate", "ACC", "MC", "PRE", "SPEC", "DSC", "JI")

#: What the paper's byte counts come to: two 32-bit indices for each point (section 1).
BYTES_PER_POINT = 8


def _beside(ours: pd.DataFrame, theirs: pd.DataFrame, on: Sequence[str]) -> pd.DataFrame:
    """Join the paper's columns to ours, their names beginning with ``paper_``."""
    renamed = theirs.rename(columns={name: f"paper_{name}" for name in theirs.columns if name not in on})
    return ours.merge(renamed, how="left", on=list(on))


def table_1(cohort: Cohort) -> pd.DataFrame:
    """Corners found by each detector, those on the boundary, and the share that is not."""
    corners = cohort.rows("corners")
    rows = corners[(corners["order"] == "chain") & (corners["parameters"] != "automatic")]
    keys = ["organ", "image", "detector", "method", "parameters"]
    table = rows.groupby(keys, sort=False)[["corners", "on_boundary"]].median().reset_index()
    total = rows.groupby(keys, sort=False)[["corners", "on_boundary"]].sum().reset_index()
    table["false_percent"] = 100 * (1 - total["on_boundary"] / total["corners"].replace(0, np.nan))
    theirs = published.TABLE_1.assign(parameters="paper, Table 2")
    return _beside(table, theirs, ["detector", "parameters"]).drop(columns="detector")


def table_2(cohort: Cohort) -> pd.DataFrame:
    """Dice and control points of every detector fused with a spline, and of CCCD."""
    corners = cohort.rows("corners")
    keys = ["organ", "image", "detector", "method", "parameters", "values", "order"]
    rows = corners.assign(
        dice_percent=100 * corners["DSC"],
        of_boundary_percent=100 * corners["control_points"] / corners["boundary_pixels"],
        self_intersecting_percent=100.0 * corners["self_intersects"],
    )
    grouped = rows.groupby(keys, sort=False)
    medians = grouped[["dice_percent", "control_points", "of_boundary_percent"]].median()
    table = medians.join(grouped["self_intersecting_percent"].mean()).reset_index()
    return _beside(table, published.TABLE_2, ["detector", "parameters"]).drop(columns="detector")


def figure_11(cohort: Cohort) -> pd.DataFrame:
    """Equations (12) to (21) of every fused detector on every image, and of CCCD; medians over slices."""
    corners = cohort.rows("corners")
    rows = corners[(corners["order"] == "tour") | (corners["detector"] == "cccd")]
    keys = ["organ", "image", "method", "parameters"]
    return rows.groupby(keys, sort=False)[["control_points", *RATES]].median().reset_index()


def figure_15(cohort: Cohort) -> pd.DataFrame:
    """Dice in percent of the snakes for every seed, medians over slices, with the least and the most."""
    rows = cohort.rows("active_contour").assign(dice_percent=lambda rows: 100 * rows["dice"])
    keys = ["organ", "method", "setting", "radius", "offset"]
    grouped = rows.groupby(keys, sort=False)["dice_percent"]
    table = grouped.agg(["median", "min", "max"]).reset_index()
    return table.rename(columns={"median": "dice_percent", "min": "least", "max": "most"})


def table_3(cohort: Cohort) -> pd.DataFrame:
    """CCCD's Dice and memory beside those that the segmentation networks' authors report."""
    corners = cohort.rows("corners")
    rows = corners[corners["detector"] == "cccd"]
    rows = rows.assign(
        k=pd.to_numeric(rows["parameters"].str.removeprefix("k = "), errors="coerce"),
        dice_percent=100 * rows["DSC"],
        boundary_pixels_used=rows["control_points"],
        of_boundary_pixels=rows["boundary_pixels"],
        memory_kb=rows["control_points"] * BYTES_PER_POINT / 1024,
        outline_kb=rows["boundary_pixels"] * BYTES_PER_POINT / 1024,
    )
    measured = ["boundary_pixels_used", "of_boundary_pixels", "dice_percent", "memory_kb", "outline_kb"]
    ours = rows.groupby(["organ", "method", "parameters", "k"], sort=False, dropna=False)[measured].median()
    ours = ours.reset_index().assign(note="this run, from the true boundary")
    theirs = published.TABLE_3.rename(columns={"boundary_pixels": "boundary_pixels_used"})
    own = theirs[theirs["method"] == CCCD].drop(columns="year")
    networks = published.NETWORKS.merge(
        theirs[["method", "boundary_pixels_used", "memory_kb"]], how="left", on="method"
    )
    networks = networks.rename(
        columns={
            "dice_percent": "paper_dice_percent",
            "boundary_pixels_used": "paper_boundary_pixels_used",
            "memory_kb": "paper_memory_kb",
        }
    ).assign(note=published.OTHER_DATA)
    own = own.astype({"k": float})
    return pd.concat([_beside(ours, own, ["method", "k"]), networks], ignore_index=True).drop(columns="k")


def segmenters(cohort: Cohort) -> pd.DataFrame:
    """Networks and CCCD on the same scans, each with the Dice that the paper has for it on the same organ.

    The paper's Table 3 is of livers. A figure of another organ, such as nnU-Net's of brain tumours, stands
    beside no row.
    """
    networks = published.NETWORKS
    networks = networks[networks["data"].str.endswith(f", {published.TABLE_3_ORGAN}")]
    own = published.TABLE_3.dropna(subset=["k"])
    names = [*networks["method"], *(f"{CCCD}, k = {k:.0f}" for k in own["k"])]
    quoted = dict(zip(names, [*networks["dice_percent"], *own["dice_percent"]], strict=True))
    table = cohort.rows("segmenters")
    theirs = table["method"].str.removesuffix(" (plain)").map(quoted)
    return table.assign(paper_dice_percent=theirs.where(table["organ"] == published.TABLE_3_ORGAN))


def table_4(cohort: Cohort) -> pd.DataFrame:
    """Segments, gaps and closed curves that each reconstruction makes of each point set."""
    reconstruction = cohort.rows("reconstruction")
    rows = reconstruction.assign(
        closed_percent=100.0 * reconstruction["closed"], dice_percent=100 * reconstruction["dice"]
    )
    grouped = rows.groupby(["organ", "points", "method", "given"], sort=False)
    counts = grouped[["n_points", "connected", "disconnected", "open_ends", "junctions", "left_out"]].median()
    table = counts.join(grouped[["closed_percent", "dice_percent"]].mean()).reset_index()
    table["rank"] = _rank(table)
    notes = {method.title: method.note for method in RECONSTRUCTIONS.values()}
    table["version"] = table["method"].map(notes)
    theirs = published.TABLE_4.assign(points=HARRIS)
    return _beside(table, theirs, ["method", "points"])


def _rank(table: pd.DataFrame) -> np.ndarray:
    """Each row's place among those that saw the points alone: by curves closed, then by Dice."""
    value = np.asarray(1e6 * table["closed_percent"].round(1) + table["dice_percent"].round(1))
    organ, points = np.asarray(table["organ"]), np.asarray(table["points"])
    beside = (organ == organ[:, None]) & (points == points[:, None]) & np.asarray(table["given"] == POINTS)
    return 1 + np.count_nonzero(beside & (value > value[:, None]), axis=1)


def table_5(cohort: Cohort) -> pd.DataFrame:
    """Processor time per slice of every detector and every reconstruction.

    Reconstructions link the Harris corners, as the paper's do, and all of the boundary's pixels; of the
    latter there is a row of CCCD, whose network finds their order before its own curve can begin.
    """
    corners, reconstruction = cohort.rows("corners"), cohort.rows("reconstruction")
    image = "grey" if (corners["image"] == "grey").any() else "mask"
    as_printed = corners["parameters"].isin(["paper, Table 2", UNTUNED, "k = 3", "automatic"])
    detected = corners[
        as_printed & corners["image"].isin([image, "chain code"]) & (corners["order"] == "chain")
    ]
    by_detector = ["organ", "detector", "method", "parameters"]
    found = detected.groupby(by_detector, sort=False)[["corner_ms", "curve_ms"]].median().reset_index()
    found = found.rename(columns={"detector": "key"})
    found.loc[found["key"] != "cccd", "curve_ms"] = np.nan

    names = {method.title: key for key, method in RECONSTRUCTIONS.items()}
    others = reconstruction["method"].isin(list(names)) & reconstruction["points"].isin([HARRIS, DENSE])
    ordered = (reconstruction["method"] == CCCD) & (reconstruction["points"] == DENSE)
    linked = reconstruction[others | (ordered & (reconstruction["given"] == POINTS))]
    linked = linked.groupby(["organ", "points", "method"], sort=False)["ms"].median()
    linked = linked.rename("curve_ms").reset_index().rename(columns={"points": "parameters"})
    linked["key"] = linked["method"].map(names).where(linked["parameters"] == HARRIS)  # the paper's points
    table = pd.concat([found, linked], ignore_index=True)
    theirs = published.TABLE_5
    table = _beside(table, theirs, ["key"])
    return table.sort_values("organ", kind="stable").drop(columns="key").reset_index(drop=True)


def corner_surfaces(cohort: Cohort) -> pd.DataFrame:
    """Surfaces from the corners of each k, with the paper's shares and Dice for the same k."""
    rows = cohort.rows("corner_surfaces")
    paper = published.TABLE_3.dropna(subset=["k"])
    theirs = pd.DataFrame(
        {
            "k": paper["k"].astype(int).astype(str),
            "paper_share": paper["boundary_pixels"] / published.TABLE_3["boundary_pixels"].max(),
            "paper_dice_2d": paper["dice_percent"] / 100,
            "paper_memory_less_percent": 100
            * (1 - paper["memory_kb"] / published.TABLE_3["memory_kb"].max()),
        }
    )
    table = rows.assign(
        k=rows["k"].astype(str),
        fewer_points_percent=100 * (1 - rows["share"]),
        memory_less_percent=100 * (1 - rows["stack_bytes"] / rows["image_bytes"]),
    )
    return table.merge(theirs, how="left", on="k")
