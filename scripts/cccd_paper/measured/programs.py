"""Ours next to programs that people use, of whole structures and of thick slices."""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd

from cccd_paper.comparisons.baselines.surfaces import FAMILIES, Program
from cccd_paper.comparisons.cohort_tables import as_smooth, at_best, baseline_rows
from cccd_paper.measured.surfaces import method_table, reference_of
from cccd_paper.measured.text import Tables, listed

__all__ = ["programs", "programs_verdict"]

_PROGRAMS = [family.title for family in FAMILIES.values() if isinstance(family, Program)]
_PLACE = ["case", "organ", "slice_distance_mm", "every_nth"]


def programs(tables: Tables) -> str:
    """Show ours, the closest baseline, and every row of the programs."""
    rows = tables["programs"]
    parts = [
        "## Next to programs that people use",
        "niimath (PyPI `niimath`: marching cubes) and 3D Slicer's own converters (PyPI `slicer-core`), run "
        "as programs on the same masks (`python tests/benchmarks/programs.py`, not in the run above; [every "
        "row](programs.csv)). niimath keeps all parts here; by default it keeps the largest, one lung of "
        f"two. Each program has a row at its defaults, and from a grid ({_grid_sizes()}) the rows that the "
        "baselines above have. The baseline is the closest of all others. Seconds are processor time from "
        "the mask on, on a busy machine; Slicer's without its start.",
    ]
    for (case, organ, distance, nth), group in rows.groupby(_PLACE, sort=False):
        kept = f", every {nth}th slice kept" if nth != 1 else ""
        title = f"**{case}/{organ}**, slices {distance:g} mm apart{kept}, {reference_of(group)}"
        parts += [title.replace("2th", "2nd"), method_table(pd.concat(_shown(group)), meshes=True)]
    return "\n\n".join([*parts, programs_verdict(tables)])


def _grid_sizes() -> str:
    sizes = [f"{len(family.settings)} settings of {name}" for name, family in _families()]
    return listed(sizes)


def _families() -> Iterator[tuple[str, Program]]:
    return ((name, family) for name, family in FAMILIES.items() if isinstance(family, Program))


def _shown(group: pd.DataFrame) -> Iterator[pd.DataFrame]:
    yield group[group["method"] == "CCCD"]
    others = baseline_rows(group[~group["method"].isin(_PROGRAMS)])
    yield others.nsmallest(1, "assd_mm")
    for name in _PROGRAMS:
        yield group[group["method"] == name].sort_values("assd_mm")


def programs_verdict(tables: Tables) -> str:
    """Say where a program is closer than ours, and where it is as smooth, too."""
    rows = tables["programs"]
    places = rows[_PLACE].drop_duplicates()
    ours = rows[rows["method"] == "CCCD"].set_index(_PLACE)["assd_mm"]
    limit = ours.loc[pd.MultiIndex.from_frame(rows[_PLACE])].to_numpy()
    closer = rows["method"].isin(_PROGRAMS) & (rows["assd_mm"] < limit)
    ratios = []
    for name in _PROGRAMS:
        best = at_best(rows[rows["method"] == name]).set_index(_PLACE)["assd_mm"]
        if len(best):
            ratio = best / ours.loc[best.index]
            ratios.append(f"{name} {ratio.min():.2f} to {ratio.max():.2f}")
    told = (
        f"On {len(places)} stacks, the ASSD of the programs at their best, divided by ours, is: "
        f"{listed(ratios)}. A program is closer than ours on {_count(rows[closer])} of them"
    )
    both = rows[closer & as_smooth(rows, _PLACE)]
    if both.empty:
        return f"{told}, always by bending more."
    named = [
        f"on {row['case']}/{row['organ']}, slices {row['slice_distance_mm']:g} mm apart, {row['method']}, "
        f"{row['setting']} ({row['assd_mm']:.3f} against {ours[tuple(row[_PLACE])]:.3f} mm)"
        for _, row in both.iterrows()
    ]
    return f"{told}. Closer and as smooth as ours: {listed(named)}."


def _count(rows: pd.DataFrame) -> int:
    return len(rows[_PLACE].drop_duplicates())
