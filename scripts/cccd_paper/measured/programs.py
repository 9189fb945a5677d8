"""Ours next to programs that people use, of whole structures and of thick slices."""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd

from cccd_paper.comparisons.baselines.surfaces import FAMILIES, Program
from cccd_paper.comparisons.cohort_tables import as_smooth, at_best, baseline_rows
from cccd_paper.comparisons.notes import listed
from cccd_paper.comparisons.paper_k import DEFAULTS
from cccd_paper.measured.surfaces import method_table, reference_of
from cccd_paper.measured.text import Tables

__all__ = ["programs", "programs_verdict"]

_PROGRAMS = [family.title for family in FAMILIES.values() if isinstance(family, Program)]
_PLACE = ["case", "organ", "slice_distance_mm", "every_nth"]


def programs(tables: Tables) -> str:
    """Show ours, the nearest baseline, and programs at their defaults and at their best."""
    rows = tables["programs"]
    parts = [
        "## Next to programs that people use",
        "niimath (PyPI `niimath`: marching cubes, here with all parts kept, as it would keep the largest "
        "alone) and 3D Slicer's own converters (PyPI `slicer-core`), run as they are on the same masks "
        "(`python tests/benchmarks/programs.py`; not of the run above; [every row](programs.csv)). Each "
        f"program has a row at its defaults and one at its best of a grid ({_grid_sizes()}); the baseline is "
        "the nearest of all the others at their best. Seconds are the processor's from the mask on (Slicer's "
        "without its start).",
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
        of_program = group[group["method"] == name]
        yield of_program[of_program["chosen"].str.contains(DEFAULTS)]
        best = at_best(of_program)
        yield best[~best["chosen"].str.contains(DEFAULTS)]


def programs_verdict(tables: Tables) -> str:
    """Say where a program is nearer than ours, and where it is that and as smooth."""
    rows = tables["programs"]
    places = rows[_PLACE].drop_duplicates()
    ours = rows[rows["method"] == "CCCD"].set_index(_PLACE)["assd_mm"]
    limit = ours.loc[pd.MultiIndex.from_frame(rows[_PLACE])].to_numpy()
    nearer = rows["method"].isin(_PROGRAMS) & (rows["assd_mm"] < limit)
    sentences = []
    for name in _PROGRAMS:
        best = at_best(rows[rows["method"] == name]).set_index(_PLACE)["assd_mm"]
        if best.empty:
            continue
        ratio = best / ours.loc[best.index]
        sentences.append(f"{name} {ratio.min():.2f} to {ratio.max():.2f}")
    told = (
        f"Over {len(places)} stacks programs at their best have, in times our ASSD: {listed(sentences)}. "
        f"One is nearer than ours on {_count(rows[nearer])}"
    )
    both = rows[nearer & as_smooth(rows, _PLACE)]
    if both.empty:
        return f"{told}, and none of these is as smooth."
    named = [
        f"{row['method']} ({row['setting']}: {row['assd_mm']:.3f} against {ours[tuple(row[_PLACE])]:.3f} mm)"
        for _, row in both.iterrows()
    ]
    where = [f"{case}/{organ}" for case, organ, *_ in both[_PLACE].drop_duplicates().itertuples(index=False)]
    return f"{told}, and both nearer and as smooth on {_count(both)}, {listed(where)}: {listed(named)}."


def _count(rows: pd.DataFrame) -> int:
    return len(rows[_PLACE].drop_duplicates())
