"""Our plots for the paper's tables and figures, and the sentences for those that the tables do not cover."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pandas as pd
from markupsafe import Markup

from cccd.report import figures
from cccd.report.tables import number, read_csv

__all__ = ["Evidence", "plots", "remarks"]

#: k at which the paper compares two organs (Figure 12).
_COARSE_K = 20

#: Parameter sets that stand for the methods as the paper ran them.
_AS_PRINTED = ("paper, Table 2", "publication", "k = 3", "automatic")

Plots = list[tuple[Markup, str]]


class Evidence:
    """The tables of a run, read once; a table that is not there is None."""

    def __init__(self, results: Path, structures: Sequence[tuple[str, str]]):
        self.results = results
        self.structures = structures
        self._read: dict[str, pd.DataFrame | None] = {}

    def table(self, stem: str) -> pd.DataFrame | None:
        """Read ``tables/<stem>.csv``."""
        if stem not in self._read:
            self._read[stem] = read_csv(self.results / "tables" / f"{stem}.csv")
        return self._read[stem]

    def comparison(self, stem: str) -> pd.DataFrame | None:
        """Read ``comparisons/<stem>.csv`` of all structures, one below the other, with their names."""
        key = f"comparisons/{stem}"
        if key not in self._read:
            parts = []
            for case, organ in self.structures:
                part = read_csv(self.results / case / organ / "comparisons" / f"{stem}.csv")
                if part is not None:
                    parts.append(part.assign(case=case, organ=organ))
            self._read[key] = pd.concat(parts, ignore_index=True) if parts else None
        return self._read[key]

    def everywhere(self, stem: str) -> pd.DataFrame | None:
        """Take the cohort's table, or the structures' own while it is not there."""
        found = self.table(stem)
        return self.comparison(stem) if found is None else found


def plots(key: str, evidence: Evidence) -> Plots:
    """Draw what there is for one exhibit: pairs of SVG and caption."""
    drawn = _PLOTS[key](evidence) if key in _PLOTS else []
    return [(Markup(svg), caption) for svg, caption in drawn if svg is not None]


def _sweep(evidence: Evidence) -> pd.DataFrame | None:
    sweep = evidence.everywhere("k_sweep")
    if sweep is None or not {"criterion", "k", "DSC"}.issubset(sweep.columns):
        return None
    return sweep.assign(structure=figures.structure_names(sweep))


def _figure_10(evidence: Evidence) -> list[tuple[str | None, str]]:
    sweep = _sweep(evidence)
    if sweep is None:
        return []
    maxima = sweep[sweep["criterion"].str.startswith("max")]
    shown = {"DSC": "Dice", "share": "Corners / boundary pixels"}
    return [
        (
            figures.lines("figure10", maxima, "k", shown, "structure"),
            "Dice of the paper's own splines and the share of boundary pixels they keep, against k; "
            "corners at maxima of curvature, medians over slices.",
        )
    ]


def _figure_11(evidence: Evidence) -> list[tuple[str | None, str]]:
    rows = evidence.comparison("corners")
    if rows is None or not {"parameters", "order", "method"}.issubset(rows.columns):
        return []
    rows = rows[rows["parameters"].isin(_AS_PRINTED) & (rows["order"] == "chain")]
    rows = rows.assign(
        method=rows["method"].where(rows["parameters"] != "automatic", rows["method"] + ", automatic")
    )
    rates = {
        "TP rate": "TP rate",
        "FP rate": "FP rate",
        "FN rate": "FN rate",
        "MC": "Misclassification",
        "DSC": "Dice",
    }
    medians = rows.groupby(["case", "organ", "method"], sort=False)[list(rates)].median().reset_index()
    return [
        (
            figures.methods("figure11", medians, "method", rates),
            "Rates by equations 12-17 and 20, with the paper's parameters and corners in their true order; "
            "medians over slices.",
        )
    ]


def _figure_12(evidence: Evidence) -> list[tuple[str | None, str]]:
    sweep = _sweep(evidence)
    if sweep is None:
        return []
    coarse = sweep[sweep["k"] == _COARSE_K]
    return [
        (
            figures.methods(
                "figure12", coarse, "structure", {"DSC": f"Dice at k = {_COARSE_K}"}, group="criterion"
            ),
            f"The same k = {_COARSE_K} on every structure, for both criteria.",
        )
    ]


def _figure_13(evidence: Evidence) -> list[tuple[str | None, str]]:
    sweep = _sweep(evidence)
    if sweep is None:
        return []
    shown = {"ACC": "Accuracy", "DSC": "Dice", "JI": "Jaccard"}
    return [
        (
            figures.lines("figure13", sweep, "k", shown, "structure", dashed="criterion"),
            "Accuracy, Dice and Jaccard against k, per structure and criterion; medians over slices.",
        )
    ]


def _figure_15(evidence: Evidence) -> list[tuple[str | None, str]]:
    rows = evidence.comparison("active_contour")
    if rows is None or not {"setting", "radius", "offset", "method", "dice"}.issubset(rows.columns):
        return []
    grid = rows[rows["setting"] == "grid"]
    wide = grid.pivot_table(index=["radius", "offset"], columns="method", values="dice", aggfunc="median")
    wide = wide.reset_index().rename_axis(columns=None)
    wide["seed"] = wide["offset"].map(lambda offset: f"seed {offset:g} radii off centre")
    shown = {name: name for name in grid["method"].unique()}
    return [
        (
            figures.lines(
                "figure15", wide.rename(columns={"radius": "seed radius"}), "seed radius", shown, "seed"
            ),
            "Dice against the seed's radius and its distance from the centroid, both in radii of the disc "
            "that has the organ's area; medians over slices and structures.",
        )
    ]


def _figure_16(evidence: Evidence) -> list[tuple[str | None, str]]:
    rows = evidence.comparison("reconstruction")
    if rows is None or not {"points", "method", "closed", "dice"}.issubset(rows.columns):
        return []
    rows = rows.assign(closed=rows["closed"].astype(float))
    means = rows.groupby(["points", "method"], sort=False)[["closed", "dice"]].mean().reset_index()
    shown = {"closed": "Share of single closed curves", "dice": "Mean Dice"}
    return [
        (
            figures.methods("figure16", means, "method", shown, group="points"),
            "How often each method links the points of a slice into one closed curve, and the Dice of what "
            "its links enclose; all slices and structures together.",
        )
    ]


def _table_5(evidence: Evidence) -> list[tuple[str | None, str]]:
    rows = evidence.table("table5_times")
    if rows is None or not {"method", "corner_ms", "curve_ms"}.issubset(rows.columns):
        return []
    rows = rows.assign(
        method=rows["method"].where(rows.get("parameters") != "automatic", rows["method"] + ", automatic")
    )
    shown = {"corner_ms": "Corners (ms)", "curve_ms": "Curve (ms)"}
    return [
        (
            figures.methods("table5", rows, "method", shown, logarithmic=shown),
            "Processor time per slice, medians, on a logarithmic axis.",
        )
    ]


def surfaces(evidence: Evidence) -> Plots:
    """Draw the surfaces that people use today beside ours."""
    rows = evidence.everywhere("surfaces")
    if rows is None:
        rows = evidence.comparison("isosurfaces")
    if rows is None:
        return []
    shown = {
        "dice_3d": "3D Dice",
        "assd_mm": "ASSD (mm)",
        "volume_bias": "Volume bias",
        "bending_per_area_mm2": "Bending / area",
        "bytes": "Bytes",
    }
    logarithmic = ("bytes", "bending_per_area_mm2")
    svg = figures.methods("surfaces", rows, "method", shown, logarithmic)
    caption = "Each dot is a structure. Bytes are those of the mesh, for ours those of the control net."
    return [(Markup(svg), caption)] if svg else []


def thick_slices(evidence: Evidence) -> Plots:
    """Draw error, roughness and bias against the distance of the slices that were kept."""
    rows = evidence.everywhere("thick_slices")
    if rows is None or "slice_distance_mm" not in rows:
        return []
    shown = {"assd_mm": "ASSD (mm)", "volume_bias": "Volume bias", "bending_per_area_mm2": "Bending / area"}
    found: Plots = []
    for name, part in rows.groupby(figures.structure_names(rows), sort=False):
        if len(found) == _MOST_PANELS:
            break
        svg = figures.lines(f"thick-{name}", part, "slice_distance_mm", shown, "method")
        if svg:
            found.append(
                (Markup(svg), f"{name}: rebuilt from every n-th slice, measured at full resolution.")
            )
    return found


#: Thick-slice plots are drawn for so many structures; the table has them all.
_MOST_PANELS = 6


def junctions(evidence: Evidence) -> Plots:
    """Draw the share of correct curves per kind of corruption, decoder by decoder."""
    rows = evidence.table("junctions")
    if rows is None:
        return []
    kind = next((name for name in ("kind", "corruption") if name in rows), None)
    decoder = next((name for name in ("decoder", "method") if name in rows), None)
    if kind is None or decoder is None:
        return []
    shown = {"correct": "Correct", "dice": "Mean Dice", "mean_dice": "Mean Dice"}
    svg = figures.methods("junctions", rows, kind, shown, group=decoder, ours="all")
    return (
        [(Markup(svg), "Share of slices whose curve is right, and mean Dice, per kind of corruption.")]
        if svg
        else []
    )


def compactness(sizes: pd.DataFrame) -> Plots:
    """Draw bytes per slice; ``sizes`` has ``case``, ``organ``, ``representation``, ``bytes_per_slice``."""
    shown = {"bytes_per_slice": "Bytes per slice (median)"}
    svg = figures.methods("compactness", sizes, "representation", shown, logarithmic=shown, ours="spline")
    caption = "The paper counts 19.2 KB for an image and 1.03 KB for its corners."
    return [(Markup(svg), caption)] if svg else []


_PLOTS = {
    "figure10": _figure_10,
    "figure11": _figure_11,
    "figure12": _figure_12,
    "figure13": _figure_13,
    "figure15": _figure_15,
    "figure16": _figure_16,
    "table5": _table_5,
}


# Sentences ----------------------------------------------------------------------------------------------


def remarks(evidence: Evidence) -> dict[str, str]:
    """Say how Figures 12, 13, 14 and 17 compare, as far as this run measured it."""
    found = {}
    sweep = _sweep(evidence)
    if sweep is not None and len(sweep):
        found |= _sweep_remarks(sweep)
    surface = evidence.everywhere("surfaces")
    surface = evidence.comparison("isosurfaces") if surface is None else surface
    if surface is not None and {"method", "bending_per_area_mm2"}.issubset(surface.columns):
        medians = surface.groupby("method")["bending_per_area_mm2"].median()
        ours = next((medians[name] for name in medians.index if "CCCD" in name), None)
        cubes = medians.get("marching cubes")
        if ours and cubes:
            less = "smoother than" if ours < cubes else "no smoother than"
            found["figure17"] = (
                f"Our surface is {less} marching cubes: its bending per area is {number(ours)} per mm², "
                f"that of marching cubes {number(cubes)}. Turn both in the view above, and the control net."
            )
    return found


def _sweep_remarks(sweep: pd.DataFrame) -> dict[str, str]:
    found = {}
    maxima = sweep[sweep["criterion"].str.startswith("max")].set_index("structure")
    minima = sweep[sweep["criterion"].str.startswith("min")]
    coarse = maxima.loc[maxima["k"] == _COARSE_K, "DSC"]
    if len(coarse) > 1:
        parts = ", ".join(f"{name} {100 * value:.1f} %" for name, value in coarse.items())
        spread = 100 * (coarse.max() - coarse.min())
        verdict = "matters here, too" if spread >= 2 else "matters little here"
        found["figure12"] = f"Which organ it is {verdict}: at k = {_COARSE_K} Dice is {parts}."
    if len(maxima) and len(minima):
        fall = {
            name: part.groupby("k")["DSC"].median() for name, part in (("maxima", maxima), ("minima", minima))
        }
        ends = {name: (100 * line.iloc[0], 100 * line.iloc[-1]) for name, line in fall.items()}
        first, last = fall["maxima"].index[0], fall["maxima"].index[-1]
        drop = {name: start - end for name, (start, end) in ends.items()}
        holds = drop["minima"] > drop["maxima"] > 0
        found["figure13"] = (
            (
                "The minimum criterion collapses first, as in the paper: "
                if holds
                else "Not the paper's order: "
            )
            + f"from k = {first} to {last} Dice goes from {ends['maxima'][0]:.1f} to {ends['maxima'][1]:.1f} % "
            f"with maxima and from {ends['minima'][0]:.1f} to {ends['minima'][1]:.1f} % with minima."
        )
    shown = maxima[maxima["k"].isin((3, 7, 12))].groupby("k")[["DSC", "share"]].median()
    if len(shown) == 3:
        parts = ", ".join(
            f"{100 * row.DSC:.1f} % from {100 * row.share:.0f} % of the pixels (k = {k})"
            for k, row in shown.iterrows()
        )
        found["figure14"] = (
            f"Dice is {parts}; the paper reports 98.49, 96.00 and 96.37 % from 39, 45 and 28 %."
        )
    return found
