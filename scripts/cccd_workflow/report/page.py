"""The pages: self-contained HTML files, readable from disk, with no request to anywhere.

`build_report` makes the cohort's page: results, warnings, and all else folded. Each case whose organs share
walls has one, too (`build_case_page`), and so has a comparison (`build_comparison_page`); each structure's is
made where it is measured (`cccd_workflow.report.structure_view.build_structure_page`). Whatever file of the
run is absent is left out.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from markupsafe import Markup

from cccd.geometry.mesh import Mesh
from cccd.plugins import find
from cccd_labels.progress import duration
from cccd_viewers.page_files import View
from cccd_viewers.viewer import case_figure, packed, surface_figure
from cccd_workflow.report.html_tables import Table, table
from cccd_workflow.report.numerals import number
from cccd_workflow.report.overviews import headline_frame, kinds_of_warnings, overview, source_table
from cccd_workflow.report.registry import Item, comparisons, items, sections
from cccd_workflow.report.results import Results
from cccd_workflow.report.structure_view import StructureView, figure_view, view_structure
from cccd_workflow.report.summary import Cohort, benchmark_table, build_tables, read_cohort
from cccd_workflow.report.templates import shared_facts, write_page

#: Width in pixels of a picture in the cohort's page.
_THUMB_WIDTH = 360

#: Plots wider than this many CSS pixels go below the paper's text instead of next to it.
_COLUMN_PX = 780

#: Above this many structures the cohort's page leaves out the pictures (some 5 kB each).
_THUMBS_BELOW = 1000

#: Up to this many structures each has a row of its own in the charts; above, each organ has.
_ROWS = 40

#: All organs of a case together are simplified to about this many triangles; one keeps the second at least.
_CASE_TRIANGLES, _ORGAN_TRIANGLES = 200_000, 400


@dataclass
class ItemView:
    """One item of the registry as the templates see it; a figure is (SVG, caption, is it wide)."""

    item: Item
    table: Table | None
    figures: list[tuple[Markup, str, bool]]


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
        The configuration as merged.
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
    found = Results(results, structures, None if cohort is None else build_tables(cohort))
    width = _THUMB_WIDTH if len(structures) <= _THUMBS_BELOW else None
    views = [view_structure(found, *key, width) for key in structures]
    for view in views:  # a page that a failed run did not come to leads nowhere
        view.link = view.link if (results / view.link).is_file() or cohort is None else ""
    cases = dict.fromkeys(case for case, _ in structures)
    write_page(
        output,
        template_dir,
        "report.html.j2",
        {
            "title": "CCCD report",
            "structures": views,
            "failures": list(failures),
            "measured": overview(views),
            "charts": _charts(views),
            "kinds": kinds_of_warnings(views),
            "distances": table("distances", found.table("distances")),
            "whole_cases": [case for case in cases if (results / case / "scene.html").is_file()],
            "sections": _sections(found),
            "sources": source_table(views),
            **_training(found, config),
            **_times(benchmarks),
            **shared_facts(config),
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


def _charts(views: Sequence[StructureView]) -> list[Markup]:
    """Draw volume, with its interval, and area: of every structure, or by organ where they are many."""
    from cccd_workflow.report import plots  # loads matplotlib, which structures' pages do without

    shown = [view for view in views if view.look_up("volume_ml") and view.look_up("surface_area_mm2")]
    if len(shown) < 2:
        return []
    titles = "Volume (ml)", "Surface area (cm²)"
    if len(shown) > _ROWS:
        return [Markup(plot) for plot in plots.strips(headline_frame(shown), list(titles), "organ")]
    names = [view.name for view in shown]
    ends = [
        (view.look_up("volume_low_ml") or np.nan, view.look_up("volume_high_ml") or np.nan) for view in shown
    ]
    volumes = [view.look_up("volume_ml") for view in shown]
    areas = [view.look_up("surface_area_mm2") / 100 for view in shown]
    nothing = [(np.nan, np.nan)] * len(shown)
    drawn = plots.ranges(names, volumes, ends, titles[0]), plots.ranges(names, areas, nothing, titles[1])
    return [Markup(plot) for plot in drawn]


def _training(results: Results, config: Mapping[str, Any]) -> dict[str, Any]:
    """Collect what the training left."""
    from cccd_workflow.report import plots

    history = results.history
    return {
        "history": table("history", history),
        "learning": None if history is None else Markup(plots.learning_curve(history) or ""),
        "training": _training_facts(results, config),
    }


def _times(benchmarks: Path | None) -> dict[str, Any]:
    """Collect time and memory of the run's jobs."""
    from cccd_workflow.report import plots

    times = benchmark_table(benchmarks)
    return {
        "times": table("rule_times", times),
        "times_plot": None if times is None else Markup(plots.rule_times(times)),
        "total_time": None if times is None else duration(float(times["total_s"].sum())),
    }


def build_case_page(
    scene: Mapping[str, Any], meshes: Mapping[str, Mesh], template_dir: Path, output: Path
) -> None:
    """Write the page of a case: all organs in one view.

    Parameters
    ----------
    scene : mapping
        What ``scene.json`` holds.
    meshes : mapping of str to Mesh
        By organ, mm RAS.
    template_dir : path
        ``workflow/report``.
    output : path
        Where the page goes.
    """
    share = min(1.0, _CASE_TRIANGLES / max(1, sum(len(mesh.faces) for mesh in meshes.values())))
    small = {
        name: mesh.simplified(max(_ORGAN_TRIANGLES, int(share * len(mesh.faces))))
        for name, mesh in meshes.items()
    }
    title = f"{scene['case']}: all organs"
    figure = packed(case_figure(scene["organs"], small))
    write_page(output, template_dir, "case.html.j2", {"title": title, "figure": figure, **shared_facts({})})


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
        if caption in views:
            view.figure = packed(surface_figure(views[caption], other=names[1], colour="distance"))
        shown.append(view)
    write_page(
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
            **shared_facts({}),
        },
    )


def _sections(results: Results) -> list[tuple[str, str, str, list[ItemView]]]:
    """Collect every section of items: anchor, title, introduction, and those items that were made."""
    made = [
        (item, results.table(item.table) if item.table is not None else None)
        for item in items()
        if item.section != "summary"
    ]
    if not any(item.needed and frame is not None for item, frame in made):
        # nothing was compared: what else there is describes the paper's tables, and is not drawn
        made = [(item, frame) for item, frame in made if item.network and frame is not None]
    views = [view for view in (_item_view(*pair, results) for pair in made) if view.table or view.figures]
    found = [
        (key, title, text, [view for view in views if view.item.section == key])
        for key, (title, text) in sections().items()
    ]
    return [section for section in found if section[3]]


def _item_view(item: Item, frame: pd.DataFrame | None, results: Results) -> ItemView:
    return ItemView(
        item,
        table(item.table or "", frame),
        [(svg, caption, _width(svg) > _COLUMN_PX) for svg, caption in _draw(item, results)],
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
