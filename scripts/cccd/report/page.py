"""The pages: one self-contained HTML file, readable from disk, with no request to anywhere.

`build_report` makes the cohort's page. Up to a number of structures everything is in it; above, it is an
index, and each structure has a page of its own (`build_structure_page`). Whatever file of the run is absent
costs one sentence on the page and nothing else.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jinja2
import pandas as pd
import yaml
from markupsafe import Markup

from cccd.console import duration
from cccd.containers import View
from cccd.lookup import find
from cccd.report import plots
from cccd.report.facts import benchmark_table, provenance
from cccd.report.html_tables import Table, table, words
from cccd.report.measures import HEADLINES
from cccd.report.numerals import number
from cccd.report.registry import Item, comparisons, items, sections
from cccd.report.render import VIEWS, VTK_PACKAGE
from cccd.report.results import Results
from cccd.report.scene import build_scene, build_surface_scene, colour_stops
from cccd.report.structure_view import (
    StructureView,
    encode_picture,
    figure_view,
    headline_frame,
    headline_label,
    source_table,
    view_structure,
)
from cccd.report.summary import Cohort, build_tables, read_cohort, write_notes
from cccd.store import atomic_path

__all__ = ["build_comparison_page", "build_report", "build_report_of_finished", "build_structure_page"]

#: Widths in pixels of a picture in a card and in the contact sheet of a cohort.
_CARD_WIDTH, _THUMB_WIDTH = 900, 240

#: Plots wider than this many CSS pixels go below the paper's text instead of beside it.
_COLUMN_PX = 780

#: Width in pixels to which large pictures are reduced.
_WIDE_PX = 1600

#: Above this many structures the index leaves out the contact sheet (some 3 kB each).
_THUMBS_BELOW = 1000


@dataclass
class ItemView:
    """One item of the registry as the templates see it; a figure is (SVG, caption, is it wide)."""

    item: Item
    note: str | None
    table: Table | None
    figures: list[tuple[Markup, str, bool]]
    missing: str | None
    picture: str | None


def build_report(
    results: Path,
    structures: Sequence[tuple[str, str]],
    failures: Sequence[str],
    config: Mapping[str, Any],
    output: Path,
    benchmarks: Path | None,
    template_dir: Path,
    cohort: Cohort | None = None,
) -> None:
    """Write the cohort's page.

    Parameters
    ----------
    results : path
        The folder that holds ``{case}/{organ}/``, ``tables/`` and ``gnn/``.
    structures : sequence of (case, organ)
        What was to be reconstructed, in the order of the sheet.
    failures : sequence of str
        One line per structure or stage that failed.
    config : mapping
        The configuration as merged; its section ``report`` holds ``pages_above``.
    output : path
        Where the page goes.
    benchmarks : path or None
        Folder of Snakemake's benchmark files.
    template_dir : path
        ``workflow/report``.
    cohort : Cohort or None
        Of the structures that are finished, where the tables of all could not be made: the page then shows
        what these come to.
    """
    found = Results(results, structures)
    if cohort is not None:
        found = Results(results, structures, build_tables(cohort), write_notes(cohort))
    index = len(structures) > config["report"]["pages_above"]
    views = _structure_views(found, index)
    _write(
        output,
        template_dir,
        "report.html.j2",
        {
            "title": "CCCD report",
            "index": index,
            "structures": views,
            "failures": list(failures),
            "measured": _measured_table(found, views, index),
            "distances": _distance_table(found),
            "whole_cases": [
                case
                for case in dict.fromkeys(case for case, _ in structures)
                if (results / case / "scene.html").is_file()
            ],
            "cohort_plots": _cohort_plots(views) if index else [],
            "sections": _sections(found),
            "sources": source_table(views),
            **_training(found, config),
            **_times(benchmarks),
            **_shared(config),
        },
    )


def build_report_of_finished(
    results: Path,
    config: Mapping[str, Any],
    output: Path,
    template_dir: Path,
    structures: Sequence[tuple[str, str]] | None = None,
    failures: Sequence[str] = (),
    benchmarks: Path | None = None,
) -> None:
    """Write the cohort's page of what is there: the structures that are measured, and their comparisons.

    Parameters
    ----------
    results, config, output, template_dir, failures, benchmarks
        See `build_report`.
    structures : sequence of (case, organ), optional
        What was to be reconstructed; what is finished, by default.
    """
    measured = {path.parent: str(path) for path in sorted(results.glob("*/*/metrics.json"))}
    if structures is None:
        structures = [(folder.parent.name, folder.name) for folder in measured]
    wanted = [results / case / organ for case, organ in structures]
    tables = [folder / "comparisons" / f"{name}.csv" for name in comparisons() for folder in wanted]
    metrics = [measured[folder] for folder in wanted if folder in measured]
    apart = {results / case / "distances.csv" for case, _ in structures}
    cohort = read_cohort([str(table) for table in tables if table.is_file()], metrics, sorted(apart))
    build_report(results, structures, failures, config, output, benchmarks, template_dir, cohort)


def _structure_views(results: Results, index: bool) -> list[StructureView]:
    """Collect every structure; an index leaves out what their own pages show."""
    thumbs = len(results.structures) <= _THUMBS_BELOW
    width = _THUMB_WIDTH if index else _CARD_WIDTH
    views = [view_structure(results, *key, width if thumbs else None) for key in results.structures]
    if not index:
        for view in views:
            files = results.files(view.case, view.organ)
            view.scene = build_scene(files)
    return views


def _training(results: Results, config: Mapping[str, Any]) -> dict[str, Any]:
    """Collect what the training left."""
    history = results.history
    return {
        "history": table("history", history) if history is not None else None,
        "learning": _markup(plots.learning_curve(history)) if history is not None else None,
        "training": _training_facts(results, config),
    }


def _times(benchmarks: Path | None) -> dict[str, Any]:
    """Collect time and memory of the run's jobs."""
    times = benchmark_table(benchmarks)
    if times is None:
        return {"times": None, "times_plot": None, "total_time": None}
    return {
        "times": table("rule_times", times),
        "times_plot": Markup(plots.rule_times(times)),
        "total_time": duration(float(times["total_s"].sum())),
    }


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
        As for `build_report`.
    case, organ : str
        Which structure.
    index : path or None
        The cohort's page, to lead back to.
    """
    found = Results(results, [(case, organ)])
    view = view_structure(found, case, organ, _CARD_WIDTH)
    files = found.files(case, organ)
    view.scene = build_scene(files)
    rows = {name: files.rows(name) for name in sorted(comparisons())}
    compared = [
        (words(name)[0], table(name, frame)) for name, frame in rows.items() if frame is not None
    ]  # fmt: skip
    _write(
        output,
        template_dir,
        "structure.html.j2",
        {
            "title": f"{case} / {organ}",
            "structure": view,
            "back": _relative(index, output.parent) if index is not None else None,
            "comparisons": compared,
            **_shared(config),
        },
    )


def build_comparison_page(
    found: Mapping[str, Any],
    views: Mapping[str, View],
    names: tuple[str, str],
    output: Path,
    template_dir: Path,
) -> None:
    """Write the page of two inputs that were compared.

    Parameters
    ----------
    found : mapping
        What ``cccd compare --json`` prints.
    views : mapping of str to View
        Both surfaces of each row that has both, by its caption.
    names : (str, str)
        What the inputs are called.
    output, template_dir : path
        As for `build_report`.
    """
    rows = pd.DataFrame(found["rows"])
    rows["notes"] = ["; ".join(notes) for notes in rows["notes"]]
    rows = rows.replace("", None)
    shown: list[StructureView] = []
    for row in found["rows"]:
        caption = " ".join(part for part in (row["label"], row["name"]) if part) or "surface"
        view = figure_view(caption, f"{names[0]}, {names[1]}", row)
        view.scene = build_surface_scene(views[caption]) if caption in views else None
        shown.append(view)
    _write(
        output,
        template_dir,
        "comparison.html.j2",
        {
            "title": f"{names[0]} and {names[1]}",
            "names": names,
            "tolerance_mm": found["tolerance_mm"],
            "notes": found["notes"],
            "rows": table("comparison", rows),
            "structures": shown,
            **_shared({}),
        },
    )


# The page as a whole ------------------------------------------------------------------------------------


def _shared(config: Mapping[str, Any]) -> dict[str, Any]:
    """Collect what both kinds of page need."""
    stops = colour_stops()
    return {
        "run": provenance(),
        "config": yaml.safe_dump(_plain(config), sort_keys=False, allow_unicode=True, width=100),
        "scales": Markup(json.dumps(stops)),
        "ramps": {
            name: "linear-gradient(to right, " + ", ".join(f"rgb({r} {g} {b})" for r, g, b in part[::8]) + ")"
            for name, part in stops.items()
        },
        "vtk_package": VTK_PACKAGE,
        "view_names": ", ".join(view.name for view in VIEWS),
    }


def _write(output: Path, template_dir: Path, name: str, context: Mapping[str, Any]) -> None:
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(template_dir),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"number": number, "bound": _bound}

    def asset(file: str) -> Markup:
        text = (Path(template_dir) / file).read_text(encoding="utf-8")
        # Comments are for those who read the source, not for every page that is made from it.
        lines = (line.rstrip() for line in text.splitlines() if not line.lstrip().startswith("// "))
        return Markup("\n".join(lines))

    environment.globals["asset"] = asset
    text = environment.get_template(name).render(context)
    with atomic_path(output) as temporary:
        temporary.write_text(text, encoding="utf-8")


def _bound(text: str) -> str:
    """Keep a number and its unit, and both sides of ``k = 3``, on one line."""
    text = re.sub(r"(?<=\d) (?=(%|mm|ms|s|[kM]?B|KB|points)\b|%)", "\u00a0", text)
    return re.sub(r"\b([kn]) = (?=\d)", "\\1\u00a0=\u00a0", text)


def _markup(svg: str | None) -> Markup | None:
    return None if svg is None else Markup(svg)


def _plain(value: Any) -> Any:
    """Copy as plain values, so that YAML writes no Python tags."""
    if isinstance(value, Mapping):
        return {str(key): _plain(part) for key, part in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(part) for part in value]
    return value if isinstance(value, (str, int, float, bool, type(None))) else str(value)


def _relative(path: Path, folder: Path) -> str:
    return Path(os.path.relpath(path, folder)).as_posix()


def _measured_table(results: Results, views: Sequence[StructureView], index: bool) -> Table | None:
    """``tables/structures.csv``, or the headlines of every structure while it is not there."""
    frame = results.table("structures")
    if frame is None:
        warnings = [len(view.warnings) for view in views]
        frame = headline_frame(views).assign(warnings=warnings)
    if frame.empty:
        return None
    links = None
    if {"case", "organ"}.issubset(frame.columns):
        paged = {(view.case, view.organ): view for view in views}
        keys = zip(frame["case"].astype(str), frame["organ"].astype(str), strict=True)
        targets = {key: view.link if index else f"#{view.id}" for key, view in paged.items()}
        links = [targets.get(key) for key in keys]
    return table("structures", frame, links)


def _distance_table(results: Results) -> Table | None:
    """Show ``tables/distances.csv``, where any organs of a case lie near each other."""
    frame = results.table("distances")
    return None if frame is None else table("distances", frame)


def _cohort_plots(views: Sequence[StructureView]) -> list[Markup]:
    labels = [headline_label(headline) for _, headline in HEADLINES]
    return [Markup(plot) for plot in plots.strips(headline_frame(views), labels, "organ")]


# Tables and figures -------------------------------------------------------------------------------------


def _sections(results: Results) -> list[tuple[str, str, str, list[ItemView]]]:
    """Collect every section of items: anchor, title, introduction and items."""
    views = [_item_view(item, results) for item in items()]
    there = [view for view in views if view.table or view.note]
    if not any(view.item.needed for view in there):
        views = [view for view in there if view.item.network]
    found = [
        (key, title, text, [view for view in views if view.item.section == key])
        for key, (title, text) in sections().items()
    ]
    return [section for section in found if section[3]]


def _item_view(item: Item, results: Results) -> ItemView:
    shown = results.table(item.table) if item.table is not None else None
    drawn = _draw(item, results)
    note = results.notes.get(item.key)
    missing = None
    if item.table is not None and shown is None:
        missing = f"This run did not make tables/{item.table}.csv."
    elif shown is None and not drawn and note is None:
        missing = "This run made no comparison for it."
    picture = results.picture(item.picture) if item.picture is not None else None
    return ItemView(
        item,
        note,
        table(item.table, shown) if item.table is not None and shown is not None else None,
        [(svg, caption, _width(svg) > _COLUMN_PX) for svg, caption in drawn],
        missing,
        encode_picture(picture, _WIDE_PX) if picture is not None else None,
    )


def _draw(item: Item, results: Results) -> list[tuple[Markup, str]]:
    """Draw what there is for one item: pairs of SVG and caption."""
    drawn = find(item.plots)(results, item) if item.plots else []
    return [(Markup(svg), caption) for svg, caption in drawn if svg is not None]


def _width(svg: str) -> float:
    """Read the natural width of a plot in CSS pixels."""
    found = re.search(r"max-width: (\d+)px", svg)
    return float(found[1]) if found else 0.0


def _training_facts(results: Results, config: Mapping[str, Any]) -> dict[str, str]:
    """Collect data counts, seed, device and time, as far as the training left them."""
    found = {"seed": str(config.get("seed", "not set"))}
    pretrained, history = (config.get("gnn") or {}).get("pretrained"), results.history
    if pretrained:
        found["weights"] = f"not trained here, taken from {pretrained}"
    elif history is not None and {"device", "seconds"}.issubset(history.columns):
        found["device"] = "; ".join(history["device"].astype(str).unique())
        found["epochs"] = f"{len(history)} in {duration(float(history['seconds'].sum()))}"
    graphs = results.graphs()
    return found if graphs is None else found | _graph_facts(*graphs)


def _graph_facts(counts: Mapping[str, int], facts: Mapping[str, Any]) -> dict[str, str]:
    """Say how many graphs there are, of what, and how large as sparse and as dense matrices."""
    found = {
        "frozen graphs": ", ".join(f"{count} {split}" for split, count in counts.items()),
        "kinds of damage": facts["kinds"].replace(",", ", ").replace("_", " "),
    }
    for name, key in (("size of the graphs", "bytes"), ("209 graphs of 1917 nodes", "bytes_paper")):
        sparse, dense = facts[key], facts[f"{key}_dense"]
        found[name] = (
            f"{number(sparse / 1e6, 1)} MB; as dense matrices {number(dense / 1e9, 2)} GB, "
            f"{number(dense / sparse, 0)} times as much"
        )
    return found
