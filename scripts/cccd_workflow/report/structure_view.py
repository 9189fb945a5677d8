"""Structures as the pages show them: headlines, warnings, pictures, what they came from."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from cccd.containers import Frame
from cccd_viewers.viewer import packed, surface_figure
from cccd_workflow.report.measures import HEADLINES, MEASURES, Headline, Measure
from cccd_workflow.report.numerals import number, typeset
from cccd_workflow.report.render import picture_renderer, webp
from cccd_workflow.report.results import Results, StructureFiles
from cccd_workflow.report.slices import SliceSheet, draw_slices
from cccd_workflow.report.templates import shared_facts, write_page

#: Width in pixels of the picture in a structure's page.
_PAGE_WIDTH = 900


@dataclass
class StructureView:
    """One structure as the templates see it; ``figure`` is what `cccd_viewers.viewer.packed` made."""

    case: str
    organ: str
    id: str
    metrics: dict[str, Any]
    headlines: list[dict[str, str]]
    warnings: list[str]
    picture: str | None = None
    renderer: str | None = None
    link: str = ""
    sources: list[dict[str, Any]] = field(default_factory=list)
    provenance: str | None = None
    grid: str | None = None
    figure: str | None = None
    slices: SliceSheet | None = None

    @property
    def name(self) -> str:
        """``case / organ`` for headings and alternative texts."""
        return f"{self.case} / {self.organ}"

    @property
    def next_slices(self) -> list[tuple[int, int]]:
        """Slices in the middle of the widest gaps, and how many slices each gap has."""
        return [(row["slice"], row["gap"]) for row in self.metrics.get("next_slices", [])]

    @property
    def measured(self) -> list[tuple[str, str]]:
        """Every number of metrics.json, in words."""
        return [(key, number(value)) for key, value in _flat(self.metrics).items()]

    def look_up(self, name: str) -> Any:
        """Take a measure by its column in ``tables/structures.csv``; None where it was not measured."""
        return next(measure for measure in MEASURES if measure.name == name).look_up(self.metrics)

    @property
    def volume_interval(self) -> str | None:
        """Interval that holds the volume nine times of ten, ml; None where there is none."""
        low, high = (self.look_up(f"volume_{side}_ml") for side in ("low", "high"))
        if low is None or high is None:
            return None
        decimals = 1 if high >= 1000 and high - low < 10 else None  # four digits would hide so narrow a one
        return f"{number(low, decimals)} to {number(high, decimals)}"


def build_structure_page(
    results: Path,
    case: str,
    organ: str,
    config: Mapping[str, Any],
    output: Path,
    template_dir: Path,
    index: Path | None = None,
) -> None:
    """Write the page of one structure.

    Parameters
    ----------
    results, config, output, template_dir
        As for `cccd_workflow.report.page.build_report`.
    case, organ : str
        Which structure.
    index : path or None
        The cohort's page, to lead back to.
    """
    found = Results(results, [(case, organ)])
    view, files = view_structure(found, case, organ, _PAGE_WIDTH), found.files(case, organ)
    view.figure, view.slices = _figure(files), draw_slices(files)
    back = Path(os.path.relpath(index, output.parent)).as_posix() if index is not None else None
    shown = {"title": f"{case} / {organ}", "structure": view, "back": back, **shared_facts(config)}
    write_page(output, template_dir, "structure.html.j2", shown)


def _figure(files: StructureFiles) -> str | None:
    """Make the figure of a structure's surface."""
    view, splines = files.view(), files.splines()
    if view is None:
        return None
    curves = splines.sample(per_pixel=0.5) if splines is not None else None
    return packed(surface_figure(view, files.bodies() or (), curves))


def view_structure(results: Results, case: str, organ: str, width: int | None) -> StructureView:
    """Collect one structure, its picture at most ``width`` pixels wide; without a width there is none."""
    files = results.files(case, organ)
    metrics = files.metrics() or {}
    pictured = width if width is not None and files.picture.is_file() else 0
    frame, facts, noticed = files.facts() or (None, {}, [])
    warnings = metrics.get("warnings") or noticed
    if frame is None:
        warnings = [*warnings, "No structure.h5: this structure was not imported."]
    return StructureView(
        case=case,
        organ=organ,
        id=re.sub(r"[^A-Za-z0-9_-]", "-", f"{case}--{organ}"),
        metrics=metrics,
        headlines=_headlines(metrics),
        warnings=warnings,
        picture=encode_picture(files.picture, pictured) if pictured else None,
        renderer=picture_renderer(files.picture) if pictured else None,
        link=f"{case}/{organ}/report.html",
        sources=_sources(facts),
        provenance=json.dumps(facts, indent=2, sort_keys=True, ensure_ascii=False) if facts else None,
        grid=_grid(frame) if frame is not None else None,
    )


def figure_view(name: str, case: str, figures: Mapping[str, Any]) -> StructureView:
    """Make the view of a surface of which there are figures alone."""
    return StructureView(
        case=case,
        organ=name,
        id=re.sub(r"[^A-Za-z0-9_-]", "-", name),
        metrics={key: value for key, value in figures.items() if value is not None},
        headlines=[],
        warnings=list(figures.get("notes", [])),
    )


def _grid(frame: Frame) -> str:
    shape = " × ".join(str(n) for n in frame.shape)
    return f"{shape} voxels of {' × '.join(number(x, 3) for x in frame.spacing)} mm"


def headline_label(headline: Headline) -> str:
    """Heading of a headline with its unit."""
    return f"{headline.heading} ({headline.unit})" if headline.unit else headline.heading


def headline_value(measure: Measure, headline: Headline, metrics: Mapping[str, Any]) -> float | None:
    """Take a headline's number in its unit; None where it was not measured."""
    found = measure.look_up(metrics)
    return None if found is None else found * headline.factor


def _headlines(metrics: Mapping[str, Any]) -> list[dict[str, str]]:
    found = []
    for measure, headline in HEADLINES:
        value = headline_value(measure, headline, metrics)
        if value is not None:
            text = number(value) if headline.form == "" else typeset(format(value, headline.form))
            found.append({"heading": headline.heading, "text": text, "unit": headline.unit})
    return found


def encode_picture(path: Path, width: int) -> str:
    """Encode a picture as base64 WebP at most ``width`` pixels wide, transparency kept."""
    from PIL import Image

    with Image.open(path) as opened:
        picture = opened.convert("RGBA")
    picture.thumbnail((width, width))
    return webp(picture, 80)


def _sources(facts: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Find every mapping anywhere in the provenance that names a file by its checksum."""
    found = []
    if isinstance(facts, Mapping):
        if "sha256" in facts:
            found.append({key: part for key, part in facts.items() if isinstance(part, (str, int, float))})
        for part in facts.values():
            found += _sources(part)
    elif isinstance(facts, list):
        for part in facts:
            found += _sources(part)
    return found


def _flat(metrics: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Numbers of nested metrics under dotted names; lists and texts are left out."""
    found: dict[str, Any] = {}
    for key, value in metrics.items():
        if isinstance(value, Mapping):
            found |= _flat(value, f"{prefix}{key} ")
        elif isinstance(value, (int, float)):
            found[f"{prefix}{key}"] = value
    return found
