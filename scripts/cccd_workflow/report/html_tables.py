"""Data frames as tables of the page: headings a person reads, numbers that line up, values that sort."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass
from numbers import Real
from typing import Any

import numpy as np
import pandas as pd

from cccd_workflow.report.numerals import number, shared_decimals

#: Endings of column names that are units, and how they are written.
UNITS = {
    "_mm": "mm",
    "_mm2": "mm²",
    "_cm2": "cm²",
    "_mm3": "mm³",
    "_ml": "ml",
    "_px": "px",
    "_deg": "°",
    "_s": "s",
    "_ms": "ms",
    "_mb": "MB",
    "_kb": "kB",
    "_bytes": "bytes",
    "_percent": "%",
    "_per_mm": "per mm",
    "_per_mm2": "per mm²",
}

#: Columns whose name does not say it well.
HEADINGS = {
    "bending_per_area_mm2": ("Bending per area", "per mm²"),
    "curvature_per_area_mm": ("Curvature per area", "per mm"),
    "dice_3d": ("3D Dice", ""),
    "ms": ("Time", "ms"),
    "seconds": ("Time", "s"),
}

#: Words that are written otherwise than in lower case.
SPELLINGS = {
    "assd": "ASSD",
    "hd95": "95 % Hausdorff",
    "hausdorff95": "95 % Hausdorff",
    "dice": "Dice",
    "jaccard": "Jaccard",
    "cccd": "CCCD",
    "gnn": "GNN",
    "f1": "F1",
    "png": "PNG",
    "csv": "CSV",
    "iou": "IoU",
    "rss": "memory",
    "cpu": "CPU",
    "dsc": "DSC",
    "hausdorff": "Hausdorff",
}


#: Columns that hold a share and are read in percent.
IN_PERCENT = {"volume_bias"}

#: Columns whose values differ by orders of magnitude: each has four digits of its own.
FOUR_DIGITS = {"volume_ml", "surface_area_cm2"}


@dataclass(frozen=True)
class Cell:
    """``text`` to read, ``value`` to sort and save; ``link`` is an address or None."""

    text: str
    value: str
    numeric: bool = False
    link: str | None = None


@dataclass(frozen=True)
class TableColumn:
    """``name`` as in the CSV; ``heading`` and ``unit`` to read."""

    name: str
    heading: str
    unit: str
    numeric: bool


@dataclass(frozen=True)
class Table:
    """A table of the page; ``key`` is its HTML id and its CSV's stem."""

    key: str
    columns: list[TableColumn]
    rows: list[list[Cell]]


def words(name: str) -> tuple[str, str]:
    """Split a column name into heading and unit.

    >>> words("assd_mm"), words("volume_bias_percent"), words("Paper Dice")
    (('ASSD', 'mm'), ('Volume bias', '%'), ('Paper Dice', ''))
    """
    if name in HEADINGS:
        return HEADINGS[name]
    unit = ""
    for ending in sorted(UNITS, key=len, reverse=True):
        if name.endswith(ending) and len(name) > len(ending):
            name, unit = name[: -len(ending)], UNITS[ending]
            break
    parts = [SPELLINGS.get(part.lower(), part) for part in re.split(r"[_\s]+", name.strip()) if part]
    heading = " ".join(parts)
    # a lone letter is a symbol and keeps its case
    return (heading if len(heading) == 1 else heading[:1].upper() + heading[1:]), unit


def _cell(value: Any, decimals: int | None, link: str | None, factor: float = 1) -> Cell:
    if value is None or value is pd.NA or (isinstance(value, Real) and not math.isfinite(value)):
        return Cell("–", "", True)
    if isinstance(value, (bool, np.bool_)):
        return Cell("yes" if value else "no", str(bool(value)), False, link)
    if isinstance(value, Real):
        return Cell(
            number(factor * value, decimals),
            repr(value.item() if isinstance(value, np.generic) else value),
            True,
            link,
        )
    return Cell(str(value), str(value), False, link)


def table(key: str, frame: pd.DataFrame | None, links: Iterable[str | None] = ()) -> Table | None:
    """Turn a data frame into a table of the page; columns without any value are left out. None without rows.

    Parameters
    ----------
    key : str
        HTML id; also the stem of the CSV's name.
    frame : pandas.DataFrame or None
    links : iterable of str or None, optional
        Where each row's first cell leads.
    """
    if frame is None or frame.empty:
        return None
    frame = frame.dropna(axis="columns", how="all")
    columns, decimals, factors = [], [], []
    for name in frame.columns:
        heading, unit = words(str(name))
        series = frame[name]
        share = name in IN_PERCENT
        unit = "%" if share else unit
        numeric = pd.api.types.is_numeric_dtype(series) and not pd.api.types.is_bool_dtype(series)
        columns.append(TableColumn(str(name), heading, unit, numeric))
        shared = numeric and name not in FOUR_DIGITS
        decimals.append((2 if share else shared_decimals(series.to_numpy(float))) if shared else None)
        factors.append(100 if share else 1)
    targets = list(links) or [None] * len(frame)
    rows = [
        [
            _cell(value, digits, None if place else link, factor)
            for place, (value, digits, factor) in enumerate(zip(row, decimals, factors, strict=True))
        ]
        for row, link in zip(frame.astype(object).itertuples(index=False, name=None), targets, strict=True)
    ]
    return Table(key, columns, rows)
