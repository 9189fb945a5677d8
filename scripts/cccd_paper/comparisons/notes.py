"""A remark on each item: our numbers and, in brackets, the paper's.

Every function takes the `Cohort` and returns the remark, an empty text where this run does not measure it.
What a remark claims is computed from the rows that it is about.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import pandas as pd

from cccd.report.numerals import number
from cccd.report.summary import Cohort, structure_names
from cccd_paper.comparisons import cohort_tables, paper_tables, published
from cccd_paper.comparisons.algorithm_1 import OURS, PAPER
from cccd_paper.comparisons.baselines import Baseline
from cccd_paper.comparisons.baselines.surfaces import FAMILIES, SURFACES, Family, Program
from cccd_paper.comparisons.cohort_tables import as_smooth, at_best, baseline_rows, figure_11_rows, has_truth
from cccd_paper.comparisons.paper_k import AUTOMATIC, CCCD, COARSE_K, DISTANCES, TABLE_3
from cccd_paper.comparisons.reconstruction_comparison import DENSE, HARRIS

__all__ = [
    "algorithm_1", "compactness", "corner_surfaces", "figure_9", "figure_10", "figure_11", "figure_12",
    "figure_13",
    "figure_14", "figure_15", "figure_16", "figure_17", "k_sweep", "listed", "map_surfaces", "ordering",
    "segmenters", "shapes", "stage_times", "surfaces", "table_1", "table_2", "table_3", "table_4", "table_5",
    "thick_slices",
]  # fmt: skip

#: CCCD's setting in the paper's comparisons.
FINEST = "k = 3"

#: Times that differ by less than this factor are called alike.
ALIKE = 2.0

#: Structures that a remark names, at most.
MOST_NAMED = 3


def listed(parts: Sequence[str]) -> str:
    """Join parts of a sentence."""
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}"


def _beside(ours: str, paper: str) -> str:
    """Our numbers, and the paper's in brackets where it has all of them."""
    return f"{ours} (the paper: {paper})" if paper and "nan" not in paper else ours


def _each(rows: pd.DataFrame, ours: str, paper: str = "") -> str:
    """Write every row by a format of its columns, the paper's numbers beside ours."""
    records = rows.reset_index().to_dict("records")
    return "; ".join(_beside(ours.format_map(record), paper.format_map(record)) for record in records)


def table_1(cohort: Cohort) -> str:
    """Count the detectors most of whose corners are off the boundary, on each image."""
    table = paper_tables.table_1(cohort).query("parameters == 'paper, Table 2'")
    shares = table.groupby(["image", "method"], sort=False)[["false_percent", "paper_false_percent"]].median()
    counts = (shares.dropna() > 50).groupby("image", sort=False).agg(["sum", "count"])
    counts.columns = ["ours", "of", "paper", "of_paper"]
    text = _each(counts, "{ours} of {of} detectors on the {image} image", "{paper} of {of_paper}")
    return f"More than half of the corners are off the boundary, with the paper's parameters, for {text}."


def table_2(cohort: Cohort) -> str:
    """Name the strongest fused detector with printed and with chosen parameters."""
    table = paper_tables.table_2(cohort)
    finest = table[(table["method"] == CCCD) & (table["parameters"] == FINEST)].set_index("organ")
    others = table[table["method"] != CCCD]
    printed = others["parameters"].str.startswith("paper")
    chosen = others["parameters"] == "best of grid"
    strongest = [_strongest(others[rows], finest) for rows in (printed, chosen)]
    return " ".join(filter(None, [*strongest, _nearest_images(table)]))


def _nearest_images(table: pd.DataFrame) -> str:
    """Name the image on which each fused detector is nearest to the paper's Dice."""
    nearest = paper_tables.nearest_images(table)
    if nearest.empty:
        return ""
    nearest["dice"] = [row[row["nearest"]] for row in nearest.to_dict("records")]
    row = "{method}, {parameters}, on the {nearest} image {dice:.2f} %"
    return f"Nearest to the paper's Dice: {_each(nearest, row, '{paper_dice_percent:.2f} %')}."


def _strongest(rows: pd.DataFrame, finest: pd.DataFrame) -> str:
    """Name the baseline with the highest Dice, and on how many organs it is ahead of CCCD at k = 3."""
    keys = ["method", "image", "order", "parameters"]
    medians = rows.groupby(keys)[["dice_percent", "of_boundary_percent", "paper_dice_percent"]].median()
    if medians["dice_percent"].isna().all():
        return ""
    best = medians.sort_values("dice_percent", ascending=False, kind="stable")[:1].reset_index()
    both = rows.merge(best[keys]).set_index("organ").join(finest, rsuffix="_cccd", how="inner")
    ahead = both[both["dice_percent"] > both["dice_percent_cccd"]]
    fewer = (ahead["control_points"] < ahead["control_points_cccd"]).sum()
    row = "{method} on the {image} image (order: {order}) at {dice_percent:.2f} % with "
    text = _each(best, row + "{of_boundary_percent:.1f} % of the pixels", "{paper_dice_percent:.2f} %")
    return (
        f"With parameters “{best['parameters'].item()}” the strongest baseline is {text}: above CCCD at "
        f"{FINEST} on {len(ahead)} of {len(both)} organs, on {fewer} of them with fewer points."
    )


def table_3(cohort: Cohort) -> str:
    """Give what CCCD keeps, and how many figures are quoted."""
    table = paper_tables.table_3(cohort)
    ours = table[table["note"].str.startswith("this run")].groupby("parameters", sort=False)
    columns = ["boundary_pixels_used", "dice_percent", "paper_dice_percent", "paper_boundary_pixels_used"]
    text = _each(
        ours[columns].median(),
        "{parameters} {dice_percent:.2f} % from {boundary_pixels_used:.0f}",
        "{paper_dice_percent:.2f} % from {paper_boundary_pixels_used:.0f}",
    )
    return (
        f"CCCD's Dice and points: {text}. "
        f"{table['dice_percent'].isna().sum()} rows are quoted, not measured: those of the networks, which "
        "start from grey images of other data, CCCD from the true boundary, so the two kinds of score do not "
        "compare."
    )


def segmenters(cohort: Cohort) -> str:
    """Count the networks that CCCD is above on the same scans, for each organ."""
    tables = paper_tables.segmenters(cohort).groupby("organ", sort=False)
    return " ".join(_networks_on(str(organ), table) for organ, table in tables)


def _networks_on(organ: str, table: pd.DataFrame) -> str:
    own, paper = f"{CCCD}, {FINEST}", table.groupby("method")["paper_dice_percent"].first()
    dice = table.groupby(["given", "method"], sort=False)["dice_percent"].mean()
    networks = dice["the image"]
    printed = paper[networks.index].dropna().sort_values(ascending=False)
    changes = [dice[name, own] - score for name, score in networks.items()]
    above = f"{(dice['the true mask', own] > networks).sum()} of {len(networks)}"
    theirs = f"{(paper[own] > printed).sum()} of {len(printed)}" if len(printed) else ""
    ranks = networks[printed.index].to_numpy()
    held, pairs = np.triu(ranks[:, None] > ranks, 1).sum(), len(ranks) * (len(ranks) - 1) // 2
    return (
        f"{organ}: CCCD at {FINEST} on the true mask, so with the organ's place given, is above "
        f"{_beside(above, theirs)} networks; on their masks it changes their Dice by {min(changes):+.2f} to "
        f"{max(changes):+.2f} points."
        + (f" {held} of the paper's {pairs} orders of two hold." if pairs else "")
    )


def table_4(cohort: Cohort) -> str:
    """Give CCCD's rank on each point set, and the leaders where it is not first."""
    table = paper_tables.table_4(cohort)
    keys = ["points", "given"]
    own = table[table["method"] == CCCD].groupby(keys, sort=False)["rank"].max().reset_index()
    others = table[(table["method"] != CCCD) & (table["rank"] == 1)].groupby("points")["method"]
    own["leaders"] = own["points"].map(others.agg(lambda names: ", ".join(dict.fromkeys(names))))
    ahead, behind = own[own["rank"] == 1], own[own["rank"] > 1]
    row = "“{points}” given {given}"
    parts = [
        f"CCCD is first on every organ from {_each(ahead, row)}." if len(ahead) else "",
        f"Its worst rank is {_each(behind, '{rank:.0f} from ' + row + ' (first: {leaders})')}."
        if len(behind)
        else "",
    ]
    return " ".join(filter(None, parts))


def table_5(cohort: Cohort) -> str:
    """Count the reconstructions that CCCD is quicker than, ordering included, and the paper's times alike."""
    table = paper_tables.table_5(cohort)
    keys = ["method", "parameters"]
    corner, curve = (
        table.groupby(keys)[[f"{part}_ms", f"paper_{part}_s"]].median().dropna()
        for part in ("corner", "curve")
    )
    ratios = np.concatenate([1000 * times.iloc[:, 1] / times.iloc[:, 0] for times in (corner, curve)])
    others = curve.drop(index=CCCD, level="method")
    slower = (others > curve.loc[[(CCCD, FINEST)]].to_numpy()).sum()
    dense = table[table["parameters"] == DENSE].groupby("method")["curve_ms"].median()
    rivals = dense[dense.index.isin(others.index.get_level_values("method"))]
    with_order = ""
    if CCCD in dense and len(rivals):
        with_order = (
            f"; with the ordering of all boundary pixels, {dense[CCCD]:.2g} ms, than "
            f"{(rivals > dense[CCCD]).sum()} of {len(rivals)} on the same pixels"
        )
    alike = ((ratios < ALIKE) & (ratios > 1 / ALIKE)).sum()
    return (
        f"With pixels in order CCCD's curve is quicker than {_beside(*map(str, slower))} of {len(others)} "
        f"reconstructions{with_order}. {alike} of {len(ratios)} of the paper's times come out within a "
        f"factor of {ALIKE:.0f}."
    )


def stage_times(cohort: Cohort) -> str:
    """Set CCCD's whole way beside the nearest other that closes every curve, structure by structure."""
    rows = cohort.rows("stage_times")
    rows = rows.assign(closed=100 * rows["closed_share"])
    rows = rows[(rows["closed"] == 100) | (rows["method"] == CCCD)].sort_values("dice_3d", ascending=False)
    best = rows.groupby(["case", "organ", rows["method"] == CCCD], sort=False).head(1)
    row = "{case}/{organ} {method} {total_ms:.0f} ms a slice ({surface_ms:.0f} of them its surface), "
    text = _each(best.sort_values(["case", "organ"]), row + "{closed:.0f} % closed, 3D Dice {dice_3d:.4f}")
    return f"CCCD and the nearest other that closes every curve: {text}."


def figure_9(cohort: Cohort) -> str:
    """Give the Dice of the fused splines and how many cross themselves."""
    corners = cohort.rows("corners")
    rows = corners[(corners["parameters"] == "paper, Figure 9") & (corners["detector"] != "cccd")]
    crossing = 100 * rows.groupby("order")["self_intersects"].mean()
    keys = ["image", "detector", "method"]
    best = rows.groupby([*keys, "order"], sort=False)["DSC"].median().groupby(keys, sort=False).max()
    printed = published.TABLE_2.query("parameters == 'paper, Figure 9'").set_index("detector")["dice_percent"]
    medians = pd.DataFrame({"dice": 100 * best, "points": rows.groupby(keys)["control_points"].median()})
    medians = medians.loc[best.index].assign(
        paper=best.index.get_level_values("detector").map(printed.to_dict())
    )
    row = "{method} on the {image} image {dice:.1f} % from {points:.0f} points"
    return (
        "With Figure 9's parameters, over all organs, the median Dice in the best of three orders: "
        f"{_each(medians, row, '{paper:.2f} %')}. By angle {crossing.get('angle', 0):.0f} % of the splines "
        f"cross themselves, by a short tour {crossing.get('tour', 0):.0f} %, along the true boundary "
        f"{crossing.get('chain', 0):.0f} %."
    )


def figure_10(cohort: Cohort) -> str:
    """Give Dice for the paper's k, and where it rises with k, for each structure and in the paper."""
    shown = _maxima(cohort).query("k in @published.CCCD_DICE.index")
    if shown.empty:
        return ""
    lines = [f"{name} {_rises(rows.set_index('k')['dice'])}" for name, rows in shown.groupby(level=0)]
    return f"Dice as k grows: {_beside('; '.join(lines), _rises(published.CCCD_DICE))}."


def _rises(line: pd.Series) -> str:
    rising = line.index[line.diff() > 0]
    values = ", ".join(f"{dice:.2f}" for dice in line)
    return f"{values} % at k = {listed([*map(str, line.index)])}" + (
        f", rising to k = {listed([*map(str, rising)])}" if len(rising) else ", falling at every step"
    )


def _maxima(cohort: Cohort, criterion: str = "max") -> pd.DataFrame:
    """Rows of the sweep for corners at maxima of curvature, with the structure's name as index."""
    sweep = cohort.rows("k_sweep")
    rows = sweep[sweep["criterion"].str.startswith(criterion)].astype({"k": int})
    return rows.assign(dice=100 * rows["DSC"]).set_index(structure_names(sweep)[rows.index].rename("name"))


def figure_11(cohort: Cohort) -> str:
    """Say who misclassifies least among the series drawn, on every organ, with Dice and points."""
    rows = figure_11_rows(cohort.rows("corners"))
    if rows.empty:
        return ""
    ours, rates = f"CCCD, {FINEST}", ["MC", "FP rate", "FN rate", "DSC", "control_points"]
    medians = (
        rows.groupby(["organ", "method"], sort=False)[rates]
        .median()
        .assign(dice=lambda rows: 100 * rows["DSC"])
    )
    own = medians[medians.index.get_level_values("method") == ours]
    least = medians.loc[medians.groupby(level="organ", sort=False)["MC"].idxmin()]
    row = "{MC:.2g} (Dice {dice:.2f} % from {control_points:.0f} points)"
    falsely = [
        f"{rate['FP rate']:.2g} and {rate['FN rate']:.2g}"
        for rate in (own.median().to_dict(), published.FIGURE_11)
    ]
    return (
        f"Least misclassified of the series drawn: {_each(least, '{organ}, {method} ' + row)}; by {ours}: "
        f"{_each(own, '{organ} ' + row)}. Its rates of false positives and false negatives: "
        f"{_beside(*falsely)}. Rates are shares of all pixels of the window (equations 12-15), so they "
        "depend on how much background it shows."
    )


def figure_12(cohort: Cohort) -> str:
    """Give every organ's Dice at the paper's k, and how far they lie apart."""
    coarse = _maxima(cohort).query("k == @COARSE_K")["dice"]
    if len(coarse) < 2:
        return ""
    lines = [
        f"{', '.join(f'{name} {dice:.1f} %' for name, dice in line.items())}, {np.ptp(line):.1f} points apart"
        for line in (coarse, published.FIGURE_12)
    ]
    return f"Dice at k = {COARSE_K}: {_beside(*lines)}."


def figure_13(cohort: Cohort) -> str:
    """Say how far Dice falls with maxima and with minima, and in the sweep's last step."""
    lines = [_maxima(cohort, name).groupby("k")["dice"].median() for name in ("max", "min")]
    if any(line.empty for line in lines):
        return ""
    drops = [line.iloc[-2:].iloc[0] - line.iloc[-1] for line in lines]
    falls = [
        f"from {line.iloc[0]:.1f} to {line.iloc[-1]:.1f} % with {name}, {drop:.1f} of it in the last step"
        for name, line, drop in zip(("maxima", "minima"), lines, drops, strict=True)
    ]
    return (
        f"From k = {lines[0].index[0]} to {lines[0].index[-1]} Dice goes {listed(falls)}: maxima "
        f"{'take' if drops[0] < drops[1] / 2 else 'do not take'} more than half of the last drop away. The "
        "paper prints no number for the drop."
    )


def figure_14(cohort: Cohort) -> str:
    """Give Dice and share of pixels for the paper's three k."""
    shown = _maxima(cohort).query("k in @TABLE_3").groupby("k")[["dice", "share"]].median()
    if len(shown) < len(TABLE_3):
        return ""
    paper = published.TABLE_3.dropna(subset=["k"]).set_index("k")
    pixels = published.TABLE_3["boundary_pixels"].max()
    rows = 100 * shown.assign(theirs=paper["boundary_pixels"] / pixels)
    rows = rows.assign(dice=shown["dice"], paper=paper["dice_percent"])
    text = _each(rows, "k = {k} {dice:.2f} % from {share:.0f} %", "{paper:.2f} % from {theirs:.0f} %")
    return f"Dice and share of the pixels: {text}."


def figure_15(cohort: Cohort) -> str:
    """Give the snakes' Dice and how much it varies with the seed."""
    rows = cohort.rows("active_contour").assign(dice=lambda rows: 100 * rows["dice"])
    seeds = rows[rows["setting"] != "grid"].groupby(["method", "setting"], sort=False)["dice"].median()
    spans = seeds.groupby("method", sort=False).agg(["min", "max", "count"])
    spread = rows.groupby(["method", "case", "organ", "slice"])["dice"].agg(np.ptp)
    spans["spread"] = spread.groupby("method").median()
    row = "{method} {min:.1f} to {max:.1f} % over {count} seeds ({spread:.0f} points on the same slice)"
    return f"Median Dice: {_beside(_each(spans, row), f'{published.FIGURE_15:.2f} % at best')}."


def figure_16(cohort: Cohort) -> str:
    """Give the segments that each method leaves of Harris corners, and how often it closes one curve."""
    rows = cohort.rows("reconstruction")
    rows = rows[rows["points"] == HARRIS]
    if rows.empty:
        return "No slice has three Harris corners."
    paper = published.TABLE_4.set_index("method")["connected"].rename("paper")
    rows = rows.assign(closed=100 * rows["closed"], dice=100 * rows["dice"])
    grouped = rows.groupby(["method", "given"], sort=False)
    table = grouped[["closed", "dice"]].mean().join(grouped["connected"].median()).join(paper, how="inner")
    text = _each(
        table,
        "{method} given {given} {closed:.0f} % (mean Dice {dice:.1f} %), segments {connected:.0f}",
        "{paper}",
    )
    return f"Slices on which Harris corners give a single closed curve: {text}."


def k_sweep(cohort: Cohort) -> str:
    """Name the detector with the best splines and the one whose corners are found again most often."""
    sweep = cohort.rows("k_sweep")
    if sweep.empty or "rotation" not in sweep:
        return ""
    sweep = sweep[~sweep["criterion"].str.startswith("min")]
    changes = ["rotation", "scale", "noise"]
    rows = sweep.groupby(["detector", "parameters"], sort=False)[["DSC", "share", *changes]]
    medians = 100 * rows.median()
    best, steady = (medians.loc[[by.idxmax()]] for by in (medians["DSC"], medians[changes].mean(axis=1)))
    found = "{rotation:.0f} % under rotation, {scale:.0f} % under scale and {noise:.0f} % under noise"
    kept = _each(best, "{detector}, {parameters}: {DSC:.1f} % from {share:.1f} % of the pixels")
    return (
        f"Medians of the structures, maxima only. Highest Dice: {kept}. Corners found again most often: "
        f"{_each(steady, '{detector}, {parameters}: ' + found)}."
    )


def algorithm_1(cohort: Cohort) -> str:
    """Compare the printed chain with ours, structure by structure."""
    rows = cohort.rows("algorithm_1")
    rows = rows.assign(name=structure_names(rows), assd_mm=rows.get("assd_mm"))
    pairs = rows[rows["method"] == PAPER].merge(
        rows[rows["method"] == OURS], on="name", suffixes=("", "_ours")
    )
    measured = pairs.dropna(subset=["assd_mm", "assd_mm_ours"])
    surfaces = _each(
        measured,
        "{name}: {closed:.0f} of {slices:.0f} slices closed, ASSD {assd_mm:.2f} mm, "
        "ours {assd_mm_ours:.2f} mm",
    )
    without = pairs[pairs["assd_mm"].isna() & pairs["assd_mm_ours"].notna()]
    none = _each(without, "{name}: {closed:.0f} of {slices:.0f} slices closed, no surface")
    parts = [part for part in (surfaces, none) if part]
    return f"{'; '.join(parts)}." if parts else ""


def corner_surfaces(cohort: Cohort) -> str:
    """Say which corner splines make the nearest surface, and what the finest take."""
    table = paper_tables.corner_surfaces(cohort)
    medians = table.groupby("k", sort=False).median(numeric_only=True)
    finest = medians[medians.index.astype(str) == "3"].assign(
        kb=medians["stack_bytes"] / 1000, mb=medians["image_bytes"] / 1e6
    )
    size = _each(
        finest,
        "; 200 slices of k = 3 take {kb:.0f} kB against {mb:.0f} MB, {memory_less_percent:.2f} % less",
        "160 KB against 64 MB, {paper_memory_less_percent:.2f} % of one image less",
    )
    best = medians["dice_3d"].idxmax()
    return (
        f"The highest 3D Dice (medians; slabs of up to {table['slices'].max():.0f} slices) has "
        f"{best if best == AUTOMATIC else f'k = {best}'}{size}. The surface is also given the number of "
        "pixels that each curve bounds, 4 bytes a curve, which these sizes include."
    )


def shapes(cohort: Cohort) -> str:
    """Count the phantoms of the true genus, and say how far off the volumes are."""
    table = cohort_tables.shapes(cohort)
    if table.empty:
        return ""
    return (
        f"The genus is the true one for {(table['genus'] == table['genus_true']).sum()} of {len(table)}. The "
        f"largest error of a volume is {100 * table['volume_bias'].abs().max():.2f} %."
    )


def figure_17(cohort: Cohort) -> str:
    """Say how much our surface bends beside marching cubes, and how long the paper's chain takes."""
    rows = cohort.rows("isosurfaces")
    if "bending_per_area_mm2" not in rows:
        return ""
    medians = at_best(rows).groupby("method")["bending_per_area_mm2"].median()
    ours, cubes = medians.get("CCCD"), medians.get("marching cubes")
    if not ours or not cubes:
        return ""
    others = medians.drop(["CCCD", DISTANCES], errors="ignore")
    smoother = others.index[others < ours].tolist()
    return (
        f"Bending per area (medians of the structures; what is smoothed by windowed sinc is at its smallest "
        f"ASSD): our surface {number(ours)} per mm², marching cubes {number(cubes)}, "
        f"{number(cubes / ours, 1)} times ours; less than ours: {listed(smoother or ['none'])}."
        f"{_surface_seconds(cohort.rows('corner_surfaces'))}"
    )


def _surface_seconds(rows: pd.DataFrame) -> str:
    if not {"surface_s", "slices"}.issubset(rows.columns):
        return ""
    seconds = rows.groupby(rows["k"].astype(str))[["surface_s"]].median().reindex(["3", AUTOMATIC]).dropna()
    seconds["paper"] = pd.Series({"3": published.FIGURE_17_S})
    return (
        f" Seconds of processor time for the surface from corners of k (medians; slabs of up to "
        f"{rows['slices'].max():.0f} slices): {_each(seconds, '{k} {surface_s:.1f}', '{paper:.3f}')}."
    )


def surfaces(cohort: Cohort) -> str:
    """Hold our surface against the best of the tuned baselines."""
    return _surfaces(cohort.rows("isosurfaces"), ["case", "organ"], {**SURFACES, **FAMILIES}.values())


def thick_slices(cohort: Cohort) -> str:
    """Hold our surface of thick slices against the best of the tuned baselines."""
    return _surfaces(cohort.rows("thick_slices"), ["case", "organ", "every_nth"], FAMILIES.values())


def _surfaces(rows: pd.DataFrame, keys: list[str], baselines: Iterable[Baseline | Family | Program]) -> str:
    rows = rows.assign(place=rows[keys].astype(str).agg("/".join, axis=1) if len(rows) else [])
    sentences = [*_against_the_best(rows), *_wrong_genus(rows)]
    return " ".join(sentences + _absent(baselines, rows) if sentences else [])


def _against_the_best(rows: pd.DataFrame) -> list[str]:
    """Compare ASSD and curvature of our row with the nearest baseline's, in each place."""
    if not {"chosen", "assd_mm"}.issubset(rows.columns):
        return []
    ours, theirs = rows[rows["method"] == "CCCD"].set_index("place"), baseline_rows(rows)
    smooth = theirs[
        as_smooth(rows, ["case", "organ", *rows.columns.intersection(["every_nth"])])[theirs.index]
    ]
    sentences = []
    for which, found in (
        ("nearest to the reference", theirs),
        ("nearest of those as smooth as ours", smooth),
    ):
        if found.empty:
            continue
        best = found.loc[found.groupby("place")["assd_mm"].idxmin()].set_index("place")
        best["distance"] = best["assd_mm"] / ours["assd_mm"]
        best["bending"] = best["curvature_per_area_mm"] / ours["curvature_per_area_mm"]
        named = (best["method"] + (", " + best["setting"].astype(object)).fillna("")).mode()[0]
        nearer = best[best["distance"] < 1].sort_values("distance")
        times = "{distance:.2f} times our ASSD at {bending:.2f} times our bending"
        medians = best[["distance", "bending"]].median().to_dict()
        sentences.append(
            f"The baseline {which} (most often {named}) has {times.format_map(medians)} (medians); it is "
            f"nearer than ours in {len(nearer)} of {len(best)} that have one"
            + (
                f": {_each(nearer[:MOST_NAMED], '{place} ({method}: ' + times + ')')}."
                if len(nearer)
                else "."
            )
        )
    if sentences and not has_truth(rows).all():
        sentences.append(
            "Where no true surface is known, distances are to the mask's own isosurface, steps included: "
            "what keeps the steps is nearer to it, and not to the organ."
        )
    return sentences


def _wrong_genus(rows: pd.DataFrame) -> list[str]:
    """Name the places at which our surface has another genus than the true one, and why."""
    if not {"genus", "genus_true"}.issubset(rows.columns):
        return []
    known = rows[has_truth(rows)].set_index("place")
    known = known.assign(found=known["genus"].map(number, na_action="ignore").fillna("none (not closed)"))
    ours = known[known["method"] == "CCCD"].join(
        known.query("method == 'marching cubes'")["found"], rsuffix="_cubes"
    )
    ours = ours.fillna({"found_cubes": "–"})
    wrong = ours[ours["genus"].fillna(-1) != ours["genus_true"]]
    if ours.empty:
        return []
    text = _each(wrong, "{place} {found}, true {genus_true:.0f}, marching cubes {found_cubes}")
    bridged = (
        " Where a gap such as a fissure shifts from slice to slice by more than its own width, it is closed "
        "for part of the way between them, and every such bridge is a handle."
    )
    right = f"Our surface has the true genus on {len(ours) - len(wrong)} of {len(ours)}"
    return [
        f"{right}{text and f'; not on {text}'}."
        + (bridged if (wrong["genus"] > wrong["genus_true"]).any() else "")
    ]


def _absent(baselines: Iterable[Baseline | Family | Program], rows: pd.DataFrame) -> list[str]:
    """Say which baselines have no row for want of a package."""
    missing: dict[str, list[str]] = {}
    for one in baselines:
        if one.package and one.title not in set(rows["method"]):
            missing.setdefault(one.package, []).append(one.title)
    return [f"No row for want of the package {name}: {listed(titles)}." for name, titles in missing.items()]


def ordering(cohort: Cohort) -> str:
    """Say how many of the traced slices the network decided, and how well."""
    rows = cohort.rows("ordering")
    if rows.empty or "decided" not in rows:
        return ""
    least = rows["dice_decided"].min()
    return (
        f"The network decided {rows['decided'].sum():.0f} of {rows['slices'].sum():.0f} slices of masks, the "
        "others are outlines already: the Dice says nothing about the network there"
        + ("." if pd.isna(least) else f"; on those decided it is {number(least, 4)} at least.")
    )


def map_surfaces(cohort: Cohort) -> str:
    """Say for every structure how many slices were decided, and which way's surface is nearest."""
    rows = cohort.rows("map_surfaces")
    rows = rows.assign(name=structure_names(rows), assd_mm=rows.get("assd_mm"), hd95_mm=rows.get("hd95_mm"))
    counts = ["decided", "slices"]
    rows[counts] = rows.groupby("name")[counts].transform("max")  # a region that is traced has none
    first = rows.sort_values("assd_mm").groupby("name", sort=False).head(1)
    text = "{name}: {decided:.0f} of {slices:.0f} slices are no outlines already"
    near = text + "; the smallest ASSD has {method}, {assd_mm:.2f} mm (HD95 {hd95_mm:.2f} mm)"
    scored = first["assd_mm"].notna()
    return f"{'. '.join(filter(None, (_each(first[scored], near), _each(first[~scored], text))))}."


def compactness(cohort: Cohort) -> str:
    """Say how many bytes a slice's splines take beside its other forms."""
    sizes = cohort_tables.compactness(cohort)
    if not {"spline", "chain_code", "raw", "png"}.issubset(sizes.columns):
        return ""
    spline, chain, raw, png = (sizes[name].median() for name in ("spline", "chain_code", "raw", "png"))
    return (
        f"Bytes of a slice (medians of the structures): splines {number(round(spline))}, its chain code, "
        f"which keeps every pixel, {number(round(chain))}. Raw contours take {number(raw / spline, 1)} times "
        "the splines', the PNG of the filled slice "
        + _beside(f"{number(png / spline, 1)} times", f"{19.2 / 1.03:.1f} times, 19.2 KB to 1.03 KB") + "."
    )  # fmt: skip
