"""Our plots for the paper's tables and figures, and the sentences for those that the tables do not cover."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd
from markupsafe import Markup

from cccd.comparisons import figures as comparison_figures
from cccd.containers import Curves
from cccd.report import figures
from cccd.report.outlines import Outline, draw_outlines, middle_curve
from cccd.report.stills import draw_surface_still
from cccd.report.svg import style, to_svg
from cccd.report.tables import number, read_csv
from cccd.store import read_curves, read_structure

__all__ = ["Evidence", "plots", "remarks"]

#: k at which the paper compares two organs (Figure 12).
_COARSE_K = 20

Plots = list[tuple[Markup, str]]


class Evidence:
    """The tables of a run, read once; a table that is not there is None."""

    def __init__(
        self, results: Path, structures: Sequence[tuple[str, str]], config: Mapping[str, Any] | None = None
    ):
        self.results = results
        self.structures = structures
        self.config = config or {}
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

    def contours(self, case: str, organ: str) -> Curves | None:
        """Read the longest curve of a structure's middle slice."""
        path = self.results / case / organ / "curves.h5"
        return middle_curve(read_curves(path)) if path.is_file() else None

    def shown(self) -> tuple[str, str] | None:
        """Choose the structure that figures of one slice show: a liver, as in the paper, or the first."""
        whole = [
            (case, organ)
            for case, organ in self.structures
            if all((self.results / case / organ / name).is_file() for name in ("structure.h5", "curves.h5"))
        ]
        return next((key for key in whole if key[1] == "liver"), whole[0] if whole else None)

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


def _on_a_slice(number: int, caption: str) -> Callable[[Evidence], list[tuple[str | None, str]]]:
    """Draw a figure of the comparisons on one slice of the structure that is shown."""

    def draw(evidence: Evidence) -> list[tuple[str | None, str]]:
        chosen = evidence.shown()
        if chosen is None or not evidence.config.get("comparisons"):
            return []
        folder = evidence.results.joinpath(*chosen)
        make = getattr(comparison_figures, f"figure_{number}")
        structure, curves = read_structure(folder / "structure.h5"), read_curves(folder / "curves.h5")
        with style():
            figure = make(structure, curves, evidence.config["comparisons"], evidence.config["seed"])
            if figure is None:
                return []
            svg = to_svg(figure, f"figure{number}", caption)
        return [(svg, f"{' / '.join(chosen)}, middle slice. {caption}")]

    return draw


_picture_15 = _on_a_slice(
    15,
    "Boundary (thin), seed (dashed), corners (dots) and the snake's end (thick), for the paper's five seeds.",
)
_picture_16 = _on_a_slice(16, "Harris corners on the boundary (dots) and the links that each method makes.")


def _outlines(evidence: Evidence, key: str, ks: Sequence[int]) -> list[tuple[str | None, str]]:
    chosen = evidence.shown()
    curve = evidence.contours(*chosen) if chosen else None
    if curve is None:
        return []
    drawn = draw_outlines(key, [Outline(f"k = {k}", curve, k) for k in ks], f"Outlines for k = {ks}")
    return [
        (
            drawn,
            f"{' / '.join(chosen)}, middle slice: boundary (band), corners (dots), spline (line); maxima of "
            "curvature.",
        )
    ]


def _figure_14(evidence: Evidence) -> list[tuple[str | None, str]]:
    return _outlines(evidence, "figure14", (3, 7, 12))


def _figure_10(evidence: Evidence) -> list[tuple[str | None, str]]:
    drawn = _outlines(evidence, "figure10", (3, 5, 7, 20))
    sweep = _sweep(evidence)
    if sweep is None:
        return drawn
    maxima = sweep[sweep["criterion"].str.startswith("max")]
    shown = {"DSC": "Dice", "share": "Corners / boundary pixels"}
    return [
        *drawn,
        (
            figures.lines("figure10", maxima, "k", shown, "structure"),
            "Dice of the paper's own splines and the share of boundary pixels they keep, against k; "
            "corners at maxima of curvature, medians over slices.",
        ),
    ]


def _figure_11(evidence: Evidence) -> list[tuple[str | None, str]]:
    rows = evidence.comparison("corners")
    if rows is None or not {"parameters", "order", "image", "detector", "method"}.issubset(rows.columns):
        return []
    with style():
        svg = to_svg(
            comparison_figures.figure_11(rows), "figure11", "Ten rates of the fused detectors and of CCCD"
        )
    return [
        (
            svg,
            "Equations 12-21, medians over slices and structures; detectors with the paper's parameters on "
            "the organ's mask, their corners along a short tour.",
        )
    ]


def _figure_12(evidence: Evidence) -> list[tuple[str | None, str]]:
    curves = {key: evidence.contours(*key) for key in evidence.structures[:4]}
    outlines = [
        Outline(" / ".join(key), curve, _COARSE_K) for key, curve in curves.items() if curve is not None
    ]
    drawn: list[tuple[str | None, str]] = []
    if outlines:
        label = f"The middle slice of every structure at k = {_COARSE_K}"
        drawn.append((draw_outlines("figure12", outlines, label), f"{label}, maxima of curvature."))
    sweep = _sweep(evidence)
    if sweep is None:
        return drawn
    coarse = sweep[sweep["k"] == _COARSE_K]
    return [
        *drawn,
        (
            figures.methods(
                "figure12", coarse, "structure", {"DSC": f"Dice at k = {_COARSE_K}"}, group="criterion"
            ),
            f"The same k = {_COARSE_K} on every structure, for both criteria.",
        ),
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
    drawn = _picture_15(evidence)
    rows = evidence.comparison("active_contour")
    if rows is None or not {"setting", "radius", "offset", "method", "dice"}.issubset(rows.columns):
        return drawn
    grid = rows[rows["setting"] == "grid"]
    wide = grid.pivot_table(index=["radius", "offset"], columns="method", values="dice", aggfunc="median")
    wide = wide.reset_index().rename_axis(columns=None)
    wide["seed"] = wide["offset"].map(lambda offset: f"seed {offset:g} radii off centre")
    shown = {name: name for name in grid["method"].unique()}
    return [
        *drawn,
        (
            figures.lines(
                "figure15-lines", wide.rename(columns={"radius": "seed radius"}), "seed radius", shown, "seed"
            ),
            "Dice against the seed's radius and its distance from the centroid, both in radii of the disc "
            "that has the organ's area; medians over slices and structures.",
        ),
    ]


def _figure_16(evidence: Evidence) -> list[tuple[str | None, str]]:
    drawn = _picture_16(evidence)
    rows = evidence.comparison("reconstruction")
    if rows is None or not {"points", "method", "closed", "dice"}.issubset(rows.columns):
        return drawn
    rows = rows.assign(closed=rows["closed"].astype(float))
    means = rows.groupby(["points", "method"], sort=False)[["closed", "dice"]].mean().reset_index()
    shown = {"closed": "Share of single closed curves", "dice": "Mean Dice"}
    return [
        *drawn,
        (
            figures.methods("figure16-dots", means, "method", shown, group="points"),
            "How often each method links the points of a slice into one closed curve, and the Dice of what "
            "its links enclose; all slices and structures together.",
        ),
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


def _figure_17(evidence: Evidence) -> list[tuple[str | None, str]]:
    chosen = evidence.shown()
    if chosen is None:
        return []
    svg = draw_surface_still("figure17", evidence.results.joinpath(*chosen))
    return [(svg, f"{' / '.join(chosen)}, from the front, flat-shaded.")]


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
    """Draw bytes per slice; ``sizes`` has ``case``, ``organ`` and a column per way to keep the contours."""
    long = sizes.melt(["case", "organ"], var_name="representation", value_name="bytes")
    long["representation"] = long["representation"].str.replace("_", " ")
    shown = {"bytes": "Bytes per slice (median)"}
    svg = figures.methods("compactness", long, "representation", shown, logarithmic=shown, ours="spline")
    caption = "The paper counts 19.2 KB for an image and 1.03 KB for its corners."
    return [(Markup(svg), caption)] if svg else []


_PLOTS = {
    "figure9": _on_a_slice(
        9,
        "Boundary (thin), corners (dots) and fused splines (thick): above with the paper's parameters, "
        "below with the best of the grid; corners ordered by a short tour.",
    ),
    "figure10": _figure_10,
    "figure11": _figure_11,
    "figure12": _figure_12,
    "figure13": _figure_13,
    "figure14": _figure_14,
    "figure15": _figure_15,
    "figure16": _figure_16,
    "figure17": _figure_17,
    "table5": _table_5,
}


# Sentences ----------------------------------------------------------------------------------------------


def remarks(evidence: Evidence) -> dict[str, str]:
    """Say how Figures 12, 13, 14 and 17 and the sizes compare, as far as this run measured it."""
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
    sizes = evidence.table("compactness")
    if sizes is not None and {"spline", "chain_code", "raw", "png"}.issubset(sizes.columns):
        found["compactness"] = _compactness_remark(sizes)
    return found


def _compactness_remark(sizes: pd.DataFrame) -> str:
    spline, chain, raw, png = (sizes[name].median() for name in ("spline", "chain_code", "raw", "png"))
    against = "fewer" if chain < spline else "more"
    return (
        f"A slice's splines take {number(round(spline))} bytes: {number(raw / spline, 1)} times less than "
        f"its raw contours, {number(png / spline, 1)} times less than its PNG (medians of the structures). "
        f"The paper's step from 19.2 to 1.03 KB, from an image to 133 corners, is {19.2 / 1.03:.1f} times. "
        f"The chain code, which keeps every pixel, takes {against}: {number(round(chain))} bytes."
    )


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
            f"The minimum criterion collapses {'first, as' if holds else 'no earlier, unlike'} in the paper: "
            f"from k = {first} to {last} Dice goes from {ends['maxima'][0]:.1f} to {ends['maxima'][1]:.1f} % "
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
