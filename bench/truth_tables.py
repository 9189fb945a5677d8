"""Tables of the exact-truth benchmark: averages over bodies, and what the page shows."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pandas as pd
from truth_rivals import NIIMATH, SLICER_EDGES, SLICER_NETS

OURS = "CCCD"

#: What stands in the column ``choice``: how the setting was chosen.
DEFAULT, FIXED, BEST = "default", "fixed", "best of grid"


def line(rows: list[dict[str, Any]]) -> str:
    """Say in one line how a stack went."""
    own = next((row for row in rows if row["method"] == OURS), None)
    stack = f"{rows[0]['body']} 1:{rows[0]['slices']:g}"
    if own is None:
        return f"{stack}: no surface"
    others = ", ".join(
        f"{row['method']} {row['choice']} {row['assd_mm']:.3f}" for row in rows if row["method"] != OURS
    )
    return (
        f"{stack}: ASSD {own['assd_mm']:.3f} mm, 95 % {own['hd95_mm']:.2f}, "
        f"farthest {own['farthest_mm']:.2f}; "
        f"normals {own['normals_median_deg']:.1f}/{own['normals_90_deg']:.1f}; "
        f"bending {own['bending_per_mm']:.3f}; "
        f"Euler {own['euler']} ({own['euler_true']}), open {own['open_edges']}; "
        f"wrong {own['wrong_voxels']}, {own['farthest_wrong_px']:.2f} px; {own['cpu_seconds']:.1f} s; "
        f"to fixed {own['assd_to_fixed']:.2f}, to best {own['assd_to_best']:.2f} | {others}"
    )


def summary(table: pd.DataFrame) -> pd.DataFrame:
    """Average the ratios of ASSD, normals and bending over the bodies of each group, by distance of slices.

    Returns
    -------
    DataFrame
        A row for each group, distance of slices and rival: means of ours divided by the rival's, and the
        worst ratio of ASSD.
    """
    keys = ["group", "body", "slices"]
    figures = {"ASSD": "assd_mm", "normals": "normals_median_deg", "bending": "bending_per_mm"}
    own = table[table["method"] == OURS]
    rivals = {
        "fixed setting": table[(table["choice"] == FIXED) & (table["assd_to_fixed"] == 1)],
        "best of grid": table[(table["choice"] == BEST) & (table["assd_to_best"] == 1)],
        **{name: table[table["method"] == name] for name in (SLICER_EDGES, SLICER_NETS, NIIMATH)},
    }
    rows = []
    for name, rival in rivals.items():
        both = own.merge(rival.drop_duplicates(keys), on=keys, suffixes=("", "_rival"))
        for (group, ratio), part in both.groupby(["group", "slices"], sort=False):
            share = {title: part[key] / part[f"{key}_rival"] for title, key in figures.items()}
            row = {"group": group, "slices": ratio, "rival": name, "worst ASSD": share["ASSD"].max()}
            rows.append(row | {title: values.mean() for title, values in share.items()})
    return pd.DataFrame(
        rows, columns=["group", "slices", "rival", "ASSD", "worst ASSD", "normals", "bending"]
    )


def markdown(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """Write a table of Markdown."""
    head = list(head)
    lines = [head, ["---"] * len(head), *map(list, rows)]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)


#: Columns of the page's table of stacks.
_HEAD = (
    *("bodies", "slices", "ASSD (mm)", "95 % (mm)", "farthest (mm)", "normals (°)", "bending (1/mm)"),
    *("Euler, true", "wrong voxels, farthest (pixels)", "CPU s", "to fixed, to best"),
)


def stack_cells(body: str, slices: float, own: dict[str, Any] | None) -> list[str]:
    """Write CCCD's figures on one stack as the page shows them."""
    stack = [body, f"1:{slices:g}"]
    if own is None:
        return [*stack, "no surface", *[""] * (len(_HEAD) - 3)]
    return [
        *stack,
        f"{own['assd_mm']:.3f}",
        f"{own['hd95_mm']:.2f}",
        f"{own['farthest_mm']:.2f}",
        f"{own['normals_median_deg']:.1f}, {own['normals_90_deg']:.1f}",
        f"{own['bending_per_mm']:.3f}",
        f"{own['euler']}, {own['euler_true']}",
        f"{own['wrong_voxels']}, {own['farthest_wrong_px']:.2f}",
        f"{own['cpu_seconds']:.1f}",
        f"{own['assd_to_fixed']:.2f}, {own['assd_to_best']:.2f}",
    ]


def page_tables(table: pd.DataFrame) -> str:
    """Write what the page shows of the table: ratios by group, and a row for each stack."""
    ratios = [
        [group, f"1:{slices:g}", rival, *(f"{value:.2f}" for value in values)]
        for group, slices, rival, *values in summary(table).itertuples(index=False)
    ]
    records: list[dict[str, Any]] = [{str(k): v for k, v in row.items()} for row in table.to_dict("records")]
    own = {(row["body"], row["slices"]): row for row in records if row["method"] == OURS}
    every = dict.fromkeys((row["body"], row["slices"]) for row in records)
    stacks = [stack_cells(*stack, own.get(stack)) for stack in every]
    head = ("bodies", "slices", "rival", "ASSD, mean", "ASSD, worst", "normals, mean", "bending, mean")
    return (
        "All methods and columns are in `docs/measured/exact_truth.csv`.\n\n"
        "CCCD's figures divided by the rival's. Below 1 CCCD is better.\n\n"
        f"{markdown(head, ratios)}\n\nCCCD's figures on each stack.\n\n{markdown(_HEAD, stacks)}"
    )


def thin_page(table: pd.DataFrame) -> str:
    """Write what the page shows of the thin masks."""
    keys = ("wrong_voxels", "farthest_wrong_px", "euler", "open_edges", "cpu_seconds")
    head = ("mask", "voxels", "wrong voxels", "farthest (px)", "Euler", "open edges", "CPU s")
    rows = (
        (row["mask"], f"{row['voxels']:,}", *("" if pd.isna(row[key]) else f"{row[key]:.4g}" for key in keys))
        for row in table.to_dict("records")
    )
    return markdown(head, rows)


def fill_page(page: str, block: str, text: str) -> str:
    """Put a text between the two markers of a block; ``ValueError`` where the page has none.

    Examples
    --------
    >>> fill_page("<!-- begin A -->old<!-- end A -->", "A", "new")
    '<!-- begin A -->\\n\\nnew\\n\\n<!-- end A -->'
    """
    begin, end = f"<!-- begin {block} -->", f"<!-- end {block} -->"
    before, found, rest = page.partition(begin)
    _, closed, after = rest.partition(end)
    if not found or not closed:
        raise ValueError(f"the page has no block {block}")
    return f"{before}{begin}\n\n{text}\n\n{end}{after}"
