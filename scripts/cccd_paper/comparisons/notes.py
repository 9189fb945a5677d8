"""One or a few sentences for each item: our numbers, and the paper's beside them.

Every function takes the `Cohort` and returns the sentences; an empty text where this run does not measure it.
What a sentence claims is computed from the rows that it speaks of: no verdict stands in a constant text, and
one that compares with the paper gives both numbers.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import pandas as pd

from cccd.report.numerals import number
from cccd.report.summary import Cohort, structure_names
from cccd_paper.comparisons import cohort_tables, paper_tables, published
from cccd_paper.comparisons.baselines import Baseline
from cccd_paper.comparisons.baselines.surfaces import FAMILIES, SURFACES, Family, Program
from cccd_paper.comparisons.cohort_tables import as_smooth, at_best, baseline_rows, figure_11_rows, has_truth
from cccd_paper.comparisons.paper_k import AUTOMATIC, CCCD, COARSE_K, DISTANCES
from cccd_paper.comparisons.reconstruction_comparison import DENSE, HARRIS
from cccd_paper.comparisons.segmenters import REFINED

__all__ = [
    "compactness", "corner_surfaces", "figure_9", "figure_10", "figure_11", "figure_12", "figure_13",
    "figure_14", "figure_15", "figure_16", "figure_17", "k_sweep", "listed", "map_surfaces", "ordering",
    "segmenters", "shapes", "surfaces", "table_1", "table_2", "table_3", "table_4", "table_5", "thick_slices",
]  # fmt: skip

#: CCCD's setting in the paper's comparisons.
FINEST = "k = 3"

#: Times that differ by less than this factor are called alike.
ALIKE = 2.0


#: Structures that a sentence names, at most.
MOST_NAMED = 3


def listed(parts: Sequence[str]) -> str:
    """Join parts of a sentence."""
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}"


def _beside(ours: str, paper: str) -> str:
    """Our number, and the paper's in brackets."""
    return f"{ours} (the paper: {paper})"


def _percent(ours: float, paper: float, digits: int = 2) -> str:
    """Write a percentage, and the paper's where it has one."""
    text = f"{ours:.{digits}f} %"
    return text if pd.isna(paper) else _beside(text, f"{paper:.2f} %")


def table_1(cohort: Cohort) -> str:
    """Name the share of corners off the boundary beside the paper's, for each image."""
    table = paper_tables.table_1(cohort)
    printed = table[table["parameters"] == "paper, Table 2"]
    sentences = []
    for image, rows in printed.groupby("image", sort=False):
        shares = (
            rows.groupby("method", sort=False)[["false_percent", "paper_false_percent"]].median().dropna()
        )
        if shares.empty:
            continue
        parts = [
            f"{method} {_percent(row.false_percent, row.paper_false_percent, 0)}"
            for method, row in shares.iterrows()
        ]
        most = int((shares["false_percent"] > 50).sum())
        sentences.append(
            f"On the {image} image, with the paper's parameters, the share off the boundary is "
            f"{listed(parts)}: above one half for {most} of {len(shares)} detectors."
        )
    return " ".join(sentences)


def table_2(cohort: Cohort) -> str:
    """Name CCCD's Dice, and the strongest fused detector with printed and with chosen parameters."""
    table = paper_tables.table_2(cohort)
    ours = table[table["method"] == CCCD]
    columns = ["dice_percent", "of_boundary_percent", "paper_dice_percent"]
    by_setting = ours.groupby("parameters", sort=False)[columns].median()
    parts = [
        f"{_percent(row.dice_percent, row.paper_dice_percent)} for {name}"
        for name, row in by_setting.iterrows()
    ]
    automatic = by_setting.loc["automatic"]
    finest = ours[ours["parameters"] == FINEST].set_index("organ")
    baselines = table[table["method"] != CCCD]
    printed = baselines["parameters"].str.startswith("paper")
    sentences = [
        f"CCCD's Dice is {listed(parts)}; the automatic fit keeps {automatic['of_boundary_percent']:.1f} % "
        "of the boundary's pixels.",
        _strongest(baselines[printed], finest, "the paper's own parameters"),
        _strongest(
            baselines[baselines["parameters"] == "best of grid"],
            finest,
            "parameters from a grid on training phantoms",
        ),
    ]
    return " ".join(sentence for sentence in sentences if sentence)


def _strongest(baselines: pd.DataFrame, finest: pd.DataFrame, chosen: str) -> str:
    """Name the baseline with the highest Dice, and on how many organs it is ahead of CCCD at k = 3."""
    keys = ["method", "image", "order", "parameters"]
    medians = baselines.groupby(keys)[["dice_percent", "of_boundary_percent", "paper_dice_percent"]].median()
    if medians.empty or medians["dice_percent"].isna().all():
        return ""
    place = int(np.nanargmax(medians["dice_percent"]))
    method, image, order, parameters = key = medians.index.tolist()[place]
    best = medians.iloc[place]
    rows = baselines.set_index(keys).sort_index().loc[[key]].set_index("organ")
    both = rows.join(finest[["dice_percent", "control_points"]], rsuffix="_cccd", how="inner")
    ahead = both[both["dice_percent"] > both["dice_percent_cccd"]]
    fewer = int((ahead["control_points"] < ahead["control_points_cccd"]).sum())
    return (
        f"With {chosen} the strongest baseline is {method} on the {image} image ({parameters}; order: "
        f"{order}) at {_percent(best['dice_percent'], best['paper_dice_percent'])} with "
        f"{best['of_boundary_percent']:.1f} % of the pixels: above CCCD at {FINEST} on {len(ahead)} of "
        f"{len(both)} organs, on {fewer} of them with fewer points."
    )


def table_3(cohort: Cohort) -> str:
    """Name what CCCD keeps, and which figures are quoted."""
    table = paper_tables.table_3(cohort)
    ours = table[table["note"].str.startswith("this run")].set_index("parameters")
    columns = ["boundary_pixels_used", "dice_percent", "paper_dice_percent", "paper_boundary_pixels_used"]
    used = ours.groupby(level=0, sort=False)[columns].median()
    parts = []
    for name, row in used.iterrows():
        text = f"{row.dice_percent:.2f} % from {row.boundary_pixels_used:.0f} points"
        if pd.notna(row.paper_dice_percent):
            text = _beside(text, f"{row.paper_dice_percent:.2f} % from {row.paper_boundary_pixels_used:.0f}")
        parts.append(f"{text} for {name}")
    quoted = table[table["dice_percent"].isna()]
    return (
        f"CCCD keeps {listed(parts)}. {len(quoted)} rows are quoted, not measured: those of the networks, "
        "which start from grey images of other data, CCCD from the true boundary, so the two kinds of score "
        "do not compare."
    )


def segmenters(cohort: Cohort) -> str:
    """Say of each organ which of the paper's orders hold among the networks and CCCD on the same scans."""
    table = paper_tables.segmenters(cohort)
    return " ".join(_networks_on(str(organ), rows) for organ, rows in table.groupby("organ", sort=False))


def _networks_on(organ: str, table: pd.DataFrame) -> str:
    dice = table.groupby(["given", "method"], sort=False)["dice_percent"].mean()
    paper = table.groupby("method")["paper_dice_percent"].first()
    grey = dice["the image"]
    moved = grey[grey.index.str.endswith(REFINED)]
    networks = grey.drop(moved.index)
    ranked = networks.sort_values(ascending=False)
    scores = [_percent(score, paper[name]) for name, score in ranked.items()]
    told = listed([f"{name} {score}" for name, score in zip(ranked.index, scores, strict=True)])
    finest, quoted_finest = dice["the true mask", f"{CCCD}, {FINEST}"], paper[f"{CCCD}, {FINEST}"]
    pairs = [
        (one, other)
        for one in networks.index
        for other in networks.index
        if paper[one] > paper[other] and one != other
    ]
    held = sum(networks[one] > networks[other] for one, other in pairs)
    above = f"{int((finest > networks).sum())} of {len(networks)}"
    quoted = paper[networks.index].dropna()
    if len(quoted):
        above = _beside(above, f"{int((quoted_finest > quoted).sum())} of {len(quoted)}")
    lost = [dice[name, f"{CCCD}, {FINEST}"] - networks[name] for name in networks.index]
    alone = dice.get(("the image and a seed", f"{CCCD}, {FINEST}"))
    return (
        f"On the same scans ({organ}): {told}. CCCD at {FINEST} on the true mask has "
        f"{_percent(finest, quoted_finest)}, above {above} networks. It is "
        f"given the place of the organ. On the networks' masks it changes their Dice by {min(lost):+.2f} to "
        f"{max(lost):+.2f} points."
        + (f" The paper's order of two holds for {held} of {len(pairs)} pairs." if pairs else "")
        + "".join(
            f" With its border moved to the image's edges, {name.removesuffix(REFINED)} has {score:.2f} %."
            for name, score in moved.items()
        )
        + (f" From a seed in place of a network, CCCD at {FINEST} has {alone:.1f} %." if alone else "")
    )


def table_4(cohort: Cohort) -> str:
    """Name CCCD's rank on each point set, and where the leaders are others."""
    table = paper_tables.table_4(cohort)
    sentences = []
    for points, rows in table.groupby("points", sort=False):
        others = rows[rows["method"] != CCCD]
        for given, own in rows[rows["method"] == CCCD].groupby("given", sort=False):
            lead = f"For the point set “{points}”, given {given}, CCCD"
            sentences.append(_place(lead, own.set_index("organ"), others))
    return " ".join(sentences)


def _place(lead: str, own: pd.DataFrame, others: pd.DataFrame) -> str:
    """Say whether CCCD is first on every organ, and who is where it is not."""
    behind = own[own["rank"] > 1]
    if behind.empty:
        leaders = others[others["rank"] == 1].groupby("method", sort=False)
        shared = [str(method) for method, group in leaders if len(group) == len(own)]
        share = f", a place shared by {listed(shared)}" if shared else ""
        return f"{lead} comes first on every organ{share}."
    first = others[(others["rank"] == 1) & others["organ"].isin(behind.index)]
    return (
        f"{lead} is not first on {listed(list(behind.index))}: it closes "
        f"{behind['closed_percent'].min():.0f} % of the curves with Dice "
        f"{behind['dice_percent'].min():.2f} % and leaves out {behind['left_out'].max():.0f} points; "
        f"the first there ({listed(sorted(set(first['method'])))}) close "
        f"{first['closed_percent'].min():.0f} % with {first['dice_percent'].min():.2f} % and leave "
        f"out {first['left_out'].max():.0f}."
    )


def table_5(cohort: Cohort) -> str:
    """Name CCCD's times beside the others', ordering included, and how many of the paper's come out alike."""
    table = paper_tables.table_5(cohort)
    keys = ["method", "parameters"]
    corner = table.groupby(keys)[["corner_ms", "paper_corner_s"]].median().dropna()
    curve = table.groupby(keys)[["curve_ms", "paper_curve_s"]].median().dropna()
    own = (CCCD, FINEST)
    ratios = np.concatenate([1000 * times.iloc[:, 1] / times.iloc[:, 0] for times in (corner, curve)])
    own_corner, own_curve = (times.T[own] for times in (corner, curve))
    alike = int(((ratios < ALIKE) & (ratios > 1 / ALIKE)).sum())
    baselines = curve[[name[0] != CCCD for name in curve.index]]
    slower = int((baselines["curve_ms"] > curve.loc[own, "curve_ms"]).sum())
    quickest, theirs = (corner.index.tolist()[corner[name].argmin()][0] for name in corner.columns)
    parts = [
        f"{name} {_times(row)}"
        for (name, _), row in zip(baselines.index.tolist(), _rows(baselines), strict=True)
    ]
    least = corner.min()
    others = listed(parts) if parts else "no other's, for want of Harris corners"
    return (
        f"Milliseconds of a slice: CCCD's corners {_times(own_corner)}, its curve {_times(own_curve)}, "
        f"{others}. {alike} of {len(ratios)} of the paper's times come out within a factor of "
        f"{ALIKE:.0f}. The quickest detector is "
        f"{_beside(f'{quickest}, {least.iloc[0]:.2g} ms', f'{theirs}, {1000 * least.iloc[1]:.0f} ms')}; "
        f"once its pixels are ordered, CCCD's curve is quicker than "
        f"{_beside(str(slower), str(_paper_slower(curve, own)))} of {len(baselines)} reconstructions."
        f"{_with_ordering(table, [name for name, _ in baselines.index.tolist()])}"
    )


def _with_ordering(table: pd.DataFrame, methods: Sequence[str]) -> str:
    """Set the time in which the network orders all boundary pixels beside the others' on the same pixels."""
    dense = table[table["parameters"] == DENSE].groupby("method")["curve_ms"].median()
    others = dense[[name for name in methods if name in dense]]
    if CCCD not in dense or others.empty:
        return ""
    times = listed([f"{name} {ms:.2g}" for name, ms in others.items()])
    slower = int((others > dense[CCCD]).sum())
    return (
        f" Ordering comes first and takes {dense[CCCD]:.2g} ms; on the same pixels, all of the boundary's, "
        f"{times} ms: with it CCCD is quicker than {slower} of {len(others)}."
    )


def stage_times(cohort: Cohort) -> str:
    """Set CCCD's whole way beside the nearest other that closes every curve, structure by structure."""
    rows = cohort.rows("stage_times")
    sentences = []
    for (case, organ), group in rows.groupby(["case", "organ"], sort=False):
        own = group[group["method"] == CCCD].iloc[0]
        others = group[(group["method"] != CCCD) & (group["closed_share"] == 1)]
        lead = (
            f"{case}/{organ}: CCCD {own['total_ms']:.0f} ms a slice ({own['surface_ms']:.0f} of them its "
            f"surface), {100 * own['closed_share']:.0f} % of the curves closed, 3D Dice {own['dice_3d']:.4f}"
        )
        if others.empty:
            sentences.append(f"{lead}; no other closes every curve.")
            continue
        best = others.sort_values("dice_3d", ascending=False, kind="stable").iloc[0]
        sentences.append(
            f"{lead}; of the others that close every curve {best['method']} has the highest, "
            f"{best['dice_3d']:.4f} in {best['total_ms']:.0f} ms."
        )
    return " ".join(sentences)


def _rows(frame: pd.DataFrame) -> list[pd.Series]:
    return [row for _, row in frame.iterrows()]


def _times(row: pd.Series) -> str:
    """Our milliseconds and the paper's, whose column holds seconds."""
    return _beside(f"{row.iloc[0]:.2g}", f"{1000 * row.iloc[1]:.0f}")


def _paper_slower(curve: pd.DataFrame, own: tuple[str, str]) -> int:
    """How many reconstructions the paper has slower than CCCD's curve."""
    return int((curve["paper_curve_s"] > curve.loc[own, "paper_curve_s"]).sum())


def figure_9(cohort: Cohort) -> str:
    """Name the Dice of the fused splines and how many cross themselves."""
    corners = cohort.rows("corners")
    rows = corners[(corners["parameters"] == "paper, Figure 9") & (corners["detector"] != "cccd")]
    crossing = 100 * rows.groupby("order")["self_intersects"].mean()
    keys = ["image", "detector", "method"]
    medians = 100 * rows.groupby([*keys, "order"], sort=False)["DSC"].median()
    points = rows.groupby(keys)["control_points"].median()
    printed = published.TABLE_2.set_index(["detector", "parameters"])["dice_percent"]
    parts = [
        f"{method} on the {image} image {_percent(score, printed[detector, 'paper, Figure 9'], 1)} from "
        f"{points[image, detector, method]:.0f} points"
        for (image, detector, method), score in medians.groupby(level=keys, sort=False).max().items()
    ]
    return (
        "With Figure 9's parameters, over all organs, the median Dice in the best of three "
        f"orders is {listed(parts)}. By angle {crossing.get('angle', 0):.0f} % of the splines cross "
        f"themselves, by a short tour {crossing.get('tour', 0):.0f} %, along the true boundary "
        f"{crossing.get('chain', 0):.0f} %."
    )


def figure_10(cohort: Cohort) -> str:
    """Say from which k to which Dice falls and rises, for each structure and in the paper."""
    maxima = _maxima(cohort)
    paper = published.CCCD_DICE
    shown = maxima[maxima["k"].isin(paper.index)]
    medians = 100 * shown.groupby("k")["DSC"].median()
    if medians.empty:
        return ""
    parts = [f"{_percent(score, paper[k])} at k = {k}" for k, score in medians.items()]
    lines = {name: rows.set_index("k")["DSC"] for name, rows in shown.groupby(level=0, sort=False)}
    steps = "; ".join(f"{name} {_rises(line)}" for name, line in lines.items())
    growing = _beside(steps, _rises(paper / 100))
    return f"Dice, medians of the structures: {listed(parts)}. As k grows: {growing}."


def _rises(line: pd.Series) -> str:
    """Say where Dice rises from one k to the next, with both values."""
    rising = [
        f"rises from {100 * line[a]:.2f} to {100 * line[b]:.2f} % from k = {a} to {b}"
        for a, b in zip(line.index[:-1], line.index[1:], strict=True)
        if line[b] > line[a]
    ]
    ends = f"{100 * line.iloc[0]:.2f} to {100 * line.iloc[-1]:.2f} %"
    return f"{listed(rising)}, {ends} in all" if rising else f"falls at every step, {ends}"


def figure_11(cohort: Cohort) -> str:
    """Name who misclassifies least among the series drawn, on every organ, with Dice and points."""
    rows = figure_11_rows(cohort.rows("corners"))
    if rows.empty:
        return ""
    rates = ["MC", "FP rate", "FN rate", "DSC", "control_points"]
    medians = rows.groupby(["organ", "method"], sort=False)[rates].median()
    ours = f"CCCD, {FINEST}"
    parts = []
    for organ, table in medians.groupby(level=0, sort=False):
        table = table.droplevel(0)
        table = table.T
        least, own = str(table.loc["MC"].astype(float).idxmin()), table[ours]
        text = f"on {organ} {least} with {_rate(table[least])}"
        parts.append(text if least == ours else f"{text}, where {ours} has {_rate(own)}")
    own = rows[rows["method"] == ours].groupby("organ")[["FP rate", "FN rate"]].median().median()
    return (
        "Of the series drawn, the least misclassification has "
        + "; ".join(parts)
        + f". Rates of false positives and false negatives at {FINEST}: "
        + _beside(
            f"{own['FP rate']:.2g} and {own['FN rate']:.2g}",
            f"{published.FIGURE_11['FP rate']:.2g} and {published.FIGURE_11['FN rate']:.2g}",
        )
        + ". Rates are shares of all pixels of the window (equations 12-15), so they depend on how much "
        "background it shows."
    )


def _rate(row: pd.Series) -> str:
    return f"{row['MC']:.2g} (Dice {100 * row['DSC']:.2f} % from {row['control_points']:.0f} points)"


def figure_15(cohort: Cohort) -> str:
    """Name the snakes' Dice and how much it varies with the seed."""
    active_contour = cohort.rows("active_contour")
    figure = active_contour[active_contour["setting"] != "grid"]
    parts = []
    for method, rows in figure.groupby("method", sort=False):
        scores = 100 * rows.groupby("setting")["dice"].median()
        parts.append(f"{method} {scores.min():.1f} to {scores.max():.1f} % over {len(scores)} seeds")
    spread = active_contour.groupby(["method", "case", "organ", "slice"])["dice"].agg(np.ptp)
    swing = 100 * spread.groupby(level=0, sort=False).median()
    wide = [f"{value:.0f} points for the {method}" for method, value in swing.items()]
    return (
        f"Median Dice: {_beside(listed(parts), f'{published.FIGURE_15:.2f} % at best')}. Over all seeds a "
        f"slice's Dice varies by {listed(wide)} (median)."
    )


def figure_16(cohort: Cohort) -> str:
    """Name the segments that each method leaves of Harris corners, and how often it closes one curve."""
    reconstruction = cohort.rows("reconstruction")
    harris = reconstruction[reconstruction["points"] == HARRIS]
    if harris.empty:
        return "No slice has three Harris corners."
    paper = published.TABLE_4.set_index("method")["connected"]
    parts = []
    for (name, given), rows in harris.groupby(["method", "given"], sort=False):
        if name in paper.index:
            way = f" given {given}" if name == CCCD else ""
            segments = _beside(f"{rows['connected'].median():.0f}", f"{paper[str(name)]}")
            parts.append(
                f"{name}{way} {100 * rows['closed'].mean():.0f} % with a mean Dice of "
                f"{100 * rows['dice'].mean():.1f} % and {segments} segments"
            )
    return (
        f"From Harris corners a single closed curve comes out on this share of the slices: {listed(parts)}."
    )


def _maxima(cohort: Cohort) -> pd.DataFrame:
    """Rows of the sweep for corners at maxima of curvature, with the structure's name as index."""
    sweep = cohort.rows("k_sweep")
    sweep = sweep.assign(structure=structure_names(sweep))
    return sweep[sweep["criterion"].str.startswith("max")].astype({"k": int}).set_index("structure")


def figure_12(cohort: Cohort) -> str:
    """Name every organ's Dice at the paper's k, and how far they lie apart."""
    maxima = _maxima(cohort)
    coarse = 100 * maxima.loc[maxima["k"] == COARSE_K, "DSC"]
    if len(coarse) < 2:
        return ""
    parts = ", ".join(f"{name} {value:.1f} %" for name, value in coarse.items())
    paper = published.FIGURE_12
    theirs = ", ".join(f"{name} {value:.2f} %" for name, value in paper.items())
    return (
        f"At k = {COARSE_K} Dice is {_beside(parts, theirs)}: "
        f"{_beside(f'{coarse.max() - coarse.min():.1f} points apart', f'{paper.max() - paper.min():.1f}')}."
    )


def figure_13(cohort: Cohort) -> str:
    """Say how far Dice falls with maxima and with minima, and in the sweep's last step."""
    sweep = cohort.rows("k_sweep")
    lines = {}
    for name in ("max", "min"):
        rows = sweep[sweep["criterion"].str.startswith(name)].astype({"k": int})
        if rows.empty:
            return ""
        lines[name] = 100 * rows.groupby("k")["DSC"].median()
    first, last = lines["max"].index[0], lines["max"].index[-1]
    parts, drops = [], {}
    for name, line in lines.items():
        drops[name] = line.iloc[-2:].iloc[0] - line.iloc[-1]
        parts.append(
            f"from {line.iloc[0]:.1f} to {line.iloc[-1]:.1f} % with {name}ima, {drops[name]:.1f} points of "
            "it in the last step"
        )
    cured = drops["max"] < drops["min"] / 2
    paper = " and ".join(f"{value:.2f} % on a {name}" for name, value in published.FIGURE_13.items())
    k_3 = _maxima(cohort)
    k_3 = 100 * k_3.loc[k_3["k"] == 3, "DSC"]
    start = ", ".join(f"{name} {value:.2f} %" for name, value in k_3.items())
    begin = f" At k = 3: {_beside(start, paper)}." if len(k_3) else ""
    return (
        f"From k = {first} to {last} Dice goes {listed(parts)}: maxima {'take' if cured else 'do not take'} "
        f"more than half of the last drop away. The drop has no number in print to hold against.{begin}"
    )


def figure_14(cohort: Cohort) -> str:
    """Name Dice and share of pixels for the paper's three k."""
    maxima = _maxima(cohort)
    paper = published.TABLE_3.dropna(subset=["k"]).set_index("k").sort_index()
    pixels = published.TABLE_3["boundary_pixels"].max()
    shown = maxima[maxima["k"].isin(paper.index)].groupby("k")[["DSC", "share"]].median()
    if len(shown) < len(paper):
        return ""
    parts = []
    for (k, row), (_, theirs) in zip(shown.iterrows(), paper.iterrows(), strict=True):
        ours = f"{100 * row.DSC:.2f} % from {100 * row.share:.0f} % of the pixels"
        printed = f"{theirs.dice_percent:.2f} % from {100 * theirs.boundary_pixels / pixels:.0f} %"
        parts.append(f"{_beside(ours, printed)} at k = {k}")
    return f"Dice is {listed(parts)}."


def k_sweep(cohort: Cohort) -> str:
    """Name the detector with the best splines and the one whose corners are found again most often."""
    sweep = cohort.rows("k_sweep")
    if sweep.empty or "rotation" not in sweep:
        return ""
    sweep = sweep.assign(series=sweep["detector"] + ", " + sweep["parameters"])
    sweep = sweep[~sweep["criterion"].str.startswith("min")]
    changes = ["rotation", "scale", "noise"]
    medians = sweep.groupby("series", sort=False)[["DSC", "share", "too_few", *changes]].median()
    best, steady = str(medians["DSC"].idxmax()), str(medians[changes].mean(axis=1).idxmax())
    own = sweep.groupby("series", sort=False)["k"].first().isna()
    found = listed([f"{100 * medians.T[steady][change]:.0f} % under {change}" for change in changes])
    parts = [f"{name} {_kept(row)}" for name, row in medians[own].iterrows()]
    return (
        f"Medians of the structures, maxima only: {best} has the highest Dice, {_kept(medians.T[best])}; "
        f"{'; '.join(parts)}. The corners found again most often are those of {steady}: {found}."
    )


def _kept(row: pd.Series) -> str:
    return f"{100 * row['DSC']:.1f} % from {100 * row['share']:.1f} % of the pixels"


def corner_surfaces(cohort: Cohort) -> str:
    """Name what the corner splines of each k keep and cost, in the plane and in space."""
    table = paper_tables.corner_surfaces(cohort)
    columns = ["share", "dice_2d", "dice_3d", "assd_mm", "stack_bytes", "image_bytes", "seconds"]
    beside = ["paper_share", "paper_dice_2d", "memory_less_percent", "paper_memory_less_percent"]
    medians = table.groupby("k", sort=False)[[*columns, *beside]].median()
    parts = []
    for k, row in medians.iterrows():
        kept = f"{100 * row['share']:.1f} % of the pixels, 2D Dice {100 * row['dice_2d']:.2f} %"
        if pd.notna(row["paper_share"]):
            kept = _beside(kept, f"{100 * row['paper_share']:.2f} % and {100 * row['paper_dice_2d']:.2f} %")
        parts.append(
            f"{k if k == AUTOMATIC else f'k = {k}'}: {kept}, 3D Dice {100 * row['dice_3d']:.2f} %, ASSD "
            f"{row['assd_mm']:.2f} mm, {row['seconds']:.1f} s"
        )
    best = medians["dice_3d"].idxmax()
    finest = medians.T.get("3")
    size = ""
    if finest is not None:
        stack = f"{finest['stack_bytes'] / 1000:.0f} kB against {finest['image_bytes'] / 1e6:.0f} MB"
        less = f"{finest['memory_less_percent']:.2f} % less"
        theirs = f"{finest['paper_memory_less_percent']:.2f} % of one image"
        size = f" 200 slices of k = 3 take {_beside(stack, '160 KB against 64 MB')}, {_beside(less, theirs)}."
    most = table["slices"].max()
    return (
        f"Medians of the structures, in slabs of up to {most:.0f} slices. {'; '.join(parts)}. The highest "
        f"3D Dice has {best if best == AUTOMATIC else f'k = {best}'}.{size} The surface is also given the "
        "number of pixels that each curve bounds, 4 bytes a curve, which these sizes include: splines of few "
        "corners are moved outwards until they enclose as many."
    )


def shapes(cohort: Cohort) -> str:
    """Set the genus found beside the true one for every phantom, and say how far off the volumes are."""
    table = cohort_tables.shapes(cohort)
    if table.empty:
        return ""
    found = table["genus"].map("{:.0f}".format, na_action="ignore").fillna("none, as it is not closed")
    rows = zip(structure_names(table), found, table["genus_true"], strict=True)
    pairs = [f"{name} {ours} / {true}" for name, ours, true in rows]
    right = int((table["genus"] == table["genus_true"]).sum())
    return (
        f"Genus found / true: {', '.join(pairs)}; the true one for {right} of {len(table)}. The largest "
        f"error of a volume is {100 * table['volume_bias'].abs().max():.2f} %."
    )


def figure_17(cohort: Cohort) -> str:
    """Say how much our surface bends beside marching cubes."""
    surfaces = cohort.rows("isosurfaces")
    if "bending_per_area_mm2" not in surfaces:
        return ""
    medians = at_best(surfaces).groupby("method")["bending_per_area_mm2"].median()
    ours, cubes = medians.get("CCCD"), medians.get("marching cubes")
    if not ours or not cubes:
        return ""
    others = medians.drop(["CCCD", DISTANCES], errors="ignore")
    smoother = [str(name) for name in others.index[others < ours]]
    less = f"less than ours is that of {listed(smoother)}" if smoother else "no other surface's is less"
    return (
        f"Our surface's bending per area is {number(ours)} per mm², that of marching cubes {number(cubes)}, "
        f"{number(cubes / ours, 1)} times ours; {less} (medians of the structures; what is "
        f"smoothed by windowed sinc is at its smallest ASSD).{_surface_seconds(cohort)}"
    )


def _surface_seconds(cohort: Cohort) -> str:
    """Say how long the paper's own chain takes to its surface, and ours, and of how many slices."""
    rows = cohort.rows("corner_surfaces")
    if not {"surface_s", "slices"}.issubset(rows.columns):
        return ""
    seconds = rows.groupby("k")["surface_s"].median()
    if not {"3", AUTOMATIC} <= set(seconds.index.astype(str)):
        return ""
    seconds.index = seconds.index.astype(str)
    ours = _beside(f"{seconds['3']:.1f} s of processor time", f"{published.FIGURE_17_S} s, slices not stated")
    return (
        f" A surface from the corners of {FINEST} takes {ours}, from the automatic splines "
        f"{seconds[AUTOMATIC]:.1f} s (medians; slabs of up to {rows['slices'].max():.0f} slices)."
    )


def surfaces(cohort: Cohort) -> str:
    """Hold our surface against the best of the tuned baselines."""
    rows = cohort.rows("isosurfaces")
    sentences = [*_against_the_best(rows, ["case", "organ"]), *_wrong_genus(rows, ["case", "organ"])]
    if sentences:
        sentences += _absent({**SURFACES, **FAMILIES}.values(), rows)
    return " ".join(sentences)


def thick_slices(cohort: Cohort) -> str:
    """Hold our surface of thick slices against the best of the tuned baselines."""
    rows = cohort.rows("thick_slices")
    keys = ["case", "organ", "every_nth"]
    sentences = [*_against_the_best(rows, keys), *_wrong_genus(rows, keys)]
    if sentences:
        sentences += _absent(FAMILIES.values(), rows)
    return " ".join(sentences)


def _against_the_best(rows: pd.DataFrame, keys: list[str]) -> list[str]:
    """Compare ASSD and curvature of our row with the nearest baseline's, in each group of rows."""
    if not {"chosen", "assd_mm"}.issubset(rows.columns):
        return []
    columns = ["assd_mm", "curvature_per_area_mm"]
    ours = rows[rows["method"] == "CCCD"].set_index(keys)[columns]
    theirs = baseline_rows(rows)
    sentences = []
    for which, candidates in (
        ("nearest to the reference", theirs),
        ("nearest of those as smooth as ours", theirs[as_smooth(rows, keys)[theirs.index]]),
    ):
        if len(candidates) == 0:
            continue
        best = candidates.loc[candidates.groupby(keys)["assd_mm"].idxmin()].set_index(keys)
        ratios = best[columns] / ours.loc[best.index]
        ratios = ratios.assign(method=best["method"], place=_places(best.reset_index(), keys).to_numpy())
        named = (best["method"] + (", " + best["setting"].astype(object)).fillna("")).mode()[0]
        distance, bending = ratios[columns].median()
        nearer = ratios[ratios["assd_mm"] < 1].sort_values("assd_mm")
        parts = [
            f"{row['place']} ({row['method']}: {row['assd_mm']:.2f} times our ASSD at {row[columns[1]]:.2f} "
            "times our bending)"
            for _, row in nearer.head(MOST_NAMED).iterrows()
        ]
        sentences.append(
            f"The baseline {which} (most often {named}) has {distance:.2f} times our ASSD at {bending:.2f} "
            f"times our bending (medians); it is nearer than ours in {len(nearer)} of {len(best)} that have "
            f"one{f', the nearest: {listed(parts)}' if parts else ''}."
        )
    if sentences and not has_truth(rows).all():
        sentences.append(
            "Where no true surface is known, distances are to the mask's own isosurface, steps included: "
            "what keeps the steps is nearer to it, and not to the organ."
        )
    return sentences


def _wrong_genus(rows: pd.DataFrame, keys: list[str]) -> list[str]:
    """Name the structures on which our surface has another genus than the true one, and why."""
    if not {"genus", "genus_true"}.issubset(rows.columns):
        return []
    known = rows[has_truth(rows)].assign(place=_places(rows, keys))
    ours = known[known["method"] == "CCCD"]
    wrong = ours[ours["genus"].fillna(-1) != ours["genus_true"]]
    if ours.empty:
        return []
    right = f"Our surface has the true genus on {len(ours) - len(wrong)} of {len(ours)}"
    if wrong.empty:
        return [f"{right}."]
    cubes = known[known["method"] == "marching cubes"].set_index("place")["genus"].dropna().to_dict()
    found = wrong["genus"].map(number, na_action="ignore").fillna("none, as it is not closed,")
    parts = [
        f"{place} {genus} where the true surface has {number(true)}"
        + (f" (marching cubes {number(cubes[place])})" if place in cubes else "")
        for place, genus, true in zip(wrong["place"], found, wrong["genus_true"], strict=True)
    ]
    why = (
        " Where handles are too many, a gap such as a fissure shifts from slice to slice by more than its "
        "own width: between the slices it is closed for part of the way, and every such bridge is a handle."
    )
    bridged = bool((wrong["genus"] > wrong["genus_true"]).any())
    return [f"{right}; not on {listed(parts)}.{why if bridged else ''}"]


def _places(rows: pd.DataFrame, keys: list[str]) -> pd.Series:
    """Write each row's group as one name: case, organ and what else tells groups apart."""
    return rows[keys].astype(str).agg("/".join, axis=1)


def _absent(baselines: Iterable[Baseline | Family | Program], rows: pd.DataFrame) -> list[str]:
    """Say which baselines have no row for want of a package."""
    methods = set(rows["method"])
    missing: dict[str, list[str]] = {}
    for one in baselines:
        if one.package and one.title not in methods:
            missing.setdefault(one.package, []).append(one.title)
    return [f"No row for want of the package {name}: {listed(titles)}." for name, titles in missing.items()]


def ordering(cohort: Cohort) -> str:
    """Say how many of the traced slices the network decided, and how well."""
    rows = cohort.rows("ordering")
    if rows.empty or "decided" not in rows:
        return ""
    slices, decided = int(rows["slices"].sum()), int(rows["decided"].sum())
    text = (
        f"Of {slices} slices of masks {slices - decided} are outlines already: there the network is not "
        f"asked, and the Dice says nothing about it. It decided {decided}"
    )
    scores = rows["dice_decided"].dropna()
    if scores.empty:
        return f"{text}."
    return f"{text}; on these its Dice against the tracing is {number(scores.min(), 4)} at least."


def map_surfaces(cohort: Cohort) -> str:
    """Say for every structure how many slices were decided, and the error of each way's surface."""
    rows = cohort.rows("map_surfaces")
    sentences = []
    for name, part in rows.groupby(structure_names(rows), sort=False):
        network = part.iloc[0]
        decided, slices = int(network["decided"]), int(network["slices"])
        text = f"{name}: {number(decided)} of {number(slices)} slices are no outlines already"
        scored = part.dropna(subset=["assd_mm"]) if "assd_mm" in part else part.iloc[:0]
        if len(scored):
            errors = [
                f"{row['method']} {number(row['assd_mm'], 2)} mm (HD95 {number(row['hd95_mm'], 2)} mm)"
                for _, row in scored.sort_values("assd_mm").iterrows()
            ]
            text += f"; ASSD, the smallest first: {listed(errors)}"
        sentences.append(f"{text}.")
    return " ".join(sentences)


def compactness(cohort: Cohort) -> str:
    """Say how many bytes a slice's splines take beside its other forms."""
    sizes = cohort_tables.compactness(cohort)
    if not {"spline", "chain_code", "raw", "png"}.issubset(sizes.columns):
        return ""
    spline, chain, raw, png = (sizes[name].median() for name in ("spline", "chain_code", "raw", "png"))
    against = "fewer" if chain < spline else "more"
    step = _beside(
        f"Against the PNG of its filled slice a slice's splines ({number(round(spline))} bytes) take "
        f"{number(png / spline, 1)} times less",
        f"{19.2 / 1.03:.1f} times, from an image of 19.2 KB to 133 corners of 1.03 KB",
    )
    return (
        f"{step}, against its raw contours {number(raw / spline, 1)} times less (medians of the structures). "
        f"The chain code, which keeps every pixel, takes {against}: {number(round(chain))} bytes."
    )
