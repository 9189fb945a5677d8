"""What the cohort's page shows of all its structures: their figures, warnings by kind, and input files."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

import pandas as pd

from cccd_workflow.report.html_tables import Table, table
from cccd_workflow.report.measures import HEADLINES
from cccd_workflow.report.numerals import number
from cccd_workflow.report.structure_view import StructureView, headline_label, headline_value


def overview(views: Sequence[StructureView]) -> Table | None:
    """Show what a person asks first of every structure; ``tables/structures.csv`` has more."""
    rows = [
        {
            "case": view.case,
            "organ": view.organ,
            "volume_ml": view.look_up("volume_ml"),
            "interval of the volume_ml": view.volume_interval,
            "surface_area_cm2": _scaled(view.look_up("surface_area_mm2"), 0.01),
            "size_mm": _size(view),
            "dice with the mask": view.look_up("dice_3d"),
            "mean_distance_mm": view.look_up("assd_mm"),
            "distance to": view.look_up("reference"),
            "warnings": len(view.warnings),
        }
        for view in views
        if view.metrics
    ]
    links = [view.link for view in views if view.metrics]
    return table("overview", pd.DataFrame(rows), links)


def _size(view: StructureView) -> str | None:
    corners = [[view.look_up(f"{side}_{axis}_mm") for axis in "xyz"] for side in ("lowest", "highest")]
    if None in corners[0] or None in corners[1]:
        return None
    return " × ".join(number(high - low, 0) for low, high in zip(*corners, strict=True))


def _scaled(value: float | None, factor: float) -> float | None:
    return None if value is None else value * factor


class WarningKind(NamedTuple):
    """Warnings that differ in their numbers alone; ``places`` are (view, whole text)."""

    text: str
    places: list[tuple[StructureView, str]]


def kinds_of_warnings(views: Sequence[StructureView]) -> list[WarningKind]:
    """Gather the warnings of all structures by kind, the most frequent first."""
    found: dict[str, list[tuple[StructureView, str]]] = {}
    for view in views:
        for warning in view.warnings:
            kind = re.sub(r"(?:…(?:, | to | and )?)+", "…", re.sub(r"\d[\d.,]*\d|\d", "…", warning))
            found.setdefault(kind, []).append((view, warning))
    kinds = [
        WarningKind(places[0][1] if len({text for _, text in places}) == 1 else kind, places)
        for kind, places in found.items()
    ]
    return sorted(kinds, key=lambda kind: -len(kind.places))


def source_table(views: Sequence[StructureView]) -> Table | None:
    """List every input file with its checksum; None where none was recorded."""
    rows = [{"structure": view.name, **source} for view in views for source in view.sources]
    return table("inputs", pd.DataFrame(rows))


def headline_frame(views: Sequence[StructureView]) -> pd.DataFrame:
    """Every structure's headlines, one row each."""
    return pd.DataFrame(
        [
            {"case": view.case, "organ": view.organ}
            | {
                headline_label(shown): headline_value(measure, shown, view.metrics)
                for measure, shown in HEADLINES
            }
            for view in views
        ]
    )
