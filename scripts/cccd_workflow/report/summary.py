"""What all structures of a run left, as one cohort, and its tables."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from cccd.plugins import find
from cccd.store import read_json, read_table
from cccd_workflow.report.measures import MEASURES
from cccd_workflow.report.registry import Item, comparisons, items


class Cohort:
    """The rows that the comparisons left for every structure, and everything measured on each.

    Parameters
    ----------
    rows : mapping of str to DataFrame
        By comparison, the structures one below the other; what is not there has no rows.
    metrics : sequence of dict
        Each structure's ``metrics.json``.
    distances : sequence of DataFrame
        Each case's distances between organs (`cccd_labels.between.DISTANCES`).
    """

    def __init__(
        self,
        rows: Mapping[str, pd.DataFrame],
        metrics: Sequence[Mapping[str, Any]] = (),
        distances: Sequence[pd.DataFrame] = (),
    ):
        self._rows = dict(rows)
        self.metrics = list(metrics)
        self.distances = list(distances)

    def rows(self, name: str) -> pd.DataFrame:
        """Rows of a comparison; a frame without rows when no structure has any."""
        if name in self._rows:
            return self._rows[name]
        return pd.DataFrame(columns=["case", "organ", *comparisons()[name].columns])

    def has(self, item: Item) -> bool:
        """Whether every comparison that an item stands on left rows; those of traced masks may lack."""
        return all(len(self.rows(comparison.name)) > 0 for comparison in item.needed)


def read_cohort(
    tables: Iterable[str | Path],
    metrics: Iterable[str | Path] = (),
    distances: Iterable[str | Path] = (),
) -> Cohort:
    """Read ``comparisons/<name>.csv`` and ``metrics.json`` of structures, and ``distances.csv`` of cases."""
    found: dict[str, list[pd.DataFrame]] = {}
    for file in map(Path, tables):
        part = read_table(file)
        if part is not None:  # else the comparison cannot be made on this structure
            found.setdefault(file.stem, []).append(part)
    rows = {name: pd.concat(parts, ignore_index=True) for name, parts in found.items()}
    apart = (read_table(file) for file in distances)
    return Cohort(rows, [read_json(file) for file in metrics], [part for part in apart if part is not None])


def build_tables(cohort: Cohort) -> dict[str, pd.DataFrame]:
    """Make every table that is not another rule's, by its stem; without rows it has columns alone."""
    return {item.table: _tabulate(item, cohort) for item in items() if item.table and item.tabulated}


def _tabulate(item: Item, cohort: Cohort) -> pd.DataFrame:
    made = pd.DataFrame()
    if cohort.has(item):
        made = find(item.tabulate)(cohort) if item.tabulate else cohort.rows(item.rows[0].name)
    return pd.DataFrame(columns=list(item.columns)) if made.empty else made


def structure_names(frame: pd.DataFrame) -> pd.Series:
    """Name each row's structure ``case / organ``; the organ alone where it says enough."""
    if not {"case", "organ"}.issubset(frame.columns):
        return pd.Series("all", index=frame.index)
    unique = frame.drop_duplicates(["case", "organ"])
    if unique["organ"].is_unique:
        return frame["organ"].astype(str)
    return frame["case"].astype(str) + " / " + frame["organ"].astype(str)


def distances(cohort: Cohort) -> pd.DataFrame:
    """List the least distances between neighbouring organs of all cases."""
    return pd.concat(cohort.distances, ignore_index=True) if cohort.distances else pd.DataFrame()


def structures(cohort: Cohort) -> pd.DataFrame:
    """One row per structure; what it cannot have stays empty."""
    rows = [
        {"case": metrics["case"], "organ": metrics["organ"]}
        | {measure.name: measure.look_up(metrics) for measure in MEASURES}
        | {"warnings": " | ".join(metrics["warnings"])}
        for metrics in cohort.metrics
    ]
    return pd.DataFrame(rows, columns=["case", "organ", *(measure.name for measure in MEASURES), "warnings"])


def benchmark_table(folder: Path | None) -> pd.DataFrame | None:
    """Time and memory per rule from Snakemake's benchmark files; None when there are none.

    Returns
    -------
    pandas.DataFrame or None
        One row per rule: ``rule``, ``jobs``, ``total_s``, ``longest_s``, ``cpu_s``, ``peak_memory_mb``;
        the slowest rule first.
    """
    if folder is None or not folder.is_dir():
        return None
    rows = []
    for path in sorted(folder.rglob("*.tsv")):
        try:
            measured = pd.read_csv(path, sep="\t", na_values="-")
        except (pd.errors.EmptyDataError, pd.errors.ParserError):
            continue
        if measured.empty or "s" not in measured:
            continue
        last = pd.to_numeric(measured.iloc[-1], errors="coerce")
        rows.append((path.stem, last["s"], last.get("cpu_time"), last.get("max_rss")))
    if not rows:
        return None
    jobs = pd.DataFrame(rows, columns=["rule", "s", "cpu", "rss"]).astype({"cpu": float, "rss": float})
    groups = jobs.groupby("rule")
    table = pd.DataFrame(
        {
            "jobs": groups.size(),
            "total_s": groups["s"].sum(),
            "longest_s": groups["s"].max(),
            "cpu_s": groups["cpu"].sum(min_count=1),
            "peak_memory_mb": groups["rss"].max(),
        }
    )
    return table.sort_values(["total_s", "longest_s"], ascending=False).reset_index()
