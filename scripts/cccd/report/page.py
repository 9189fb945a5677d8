"""The pages: one self-contained HTML file, readable from disk, with no request to anywhere.

`build_report` makes the cohort's page. Up to a number of structures everything is in it; above, it is an
index, and each structure has a page of its own (`build_structure_page`). Whatever file of the run is absent
costs one sentence on the page and nothing else.
"""

from __future__ import annotations

import base64
import io
import json
import os
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import jinja2
import pandas as pd
import yaml
from markupsafe import Markup

from cccd.report import exhibits, figures
from cccd.report.exhibits import Evidence
from cccd.report.facts import benchmark_table, duration, provenance
from cccd.report.paper import EXHIBITS, Exhibit
from cccd.report.render import VIEWS, VTK_PACKAGE, picture_renderer
from cccd.report.scene import Scene, build_scene, colour_stops
from cccd.report.tables import Table, number, read_csv, table, typeset, words
from cccd.store import atomic_path, read_structure_facts

__all__ = ["build_report", "build_structure_page"]


class Headline(NamedTuple):
    """A number by which a surface is judged at a glance.

    ``path`` says where it stands in metrics.json, ``factor`` turns it into ``unit``, ``form`` is its format.
    """

    path: tuple[str, ...]
    heading: str
    unit: str
    factor: float
    form: str

    @property
    def label(self) -> str:
        """Heading with its unit."""
        return f"{self.heading} ({self.unit})" if self.unit else self.heading

    def value(self, metrics: Mapping[str, Any]) -> float | None:
        """Take the number in ``unit``; None where it was not measured."""
        found: Any = metrics
        for key in self.path:
            found = found.get(key) if isinstance(found, Mapping) else None
        return None if found is None else found * self.factor


HEADLINES = (
    Headline(("surface", "dice_3d"), "3D Dice", "", 1, ".4f"),
    Headline(("surface", "assd_mm"), "ASSD", "mm", 1, ".2f"),
    Headline(("surface", "volume_bias"), "Volume bias", "%", 100, "+z.2f"),
    Headline(("surface", "control_points"), "Control points", "", 1, ",d"),
    Headline(("surface", "control_bytes"), "Control net", "kB", 1e-3, ".1f"),
    Headline(("surface", "compactness"), "Smaller than marching cubes", "×", 1, ".0f"),
)

#: Widths in pixels of a picture in a card and in the contact sheet of a cohort.
_CARD_WIDTH, _THUMB_WIDTH = 900, 240

#: Plots wider than this many CSS pixels go below the paper's text instead of beside it.
_COLUMN_PX = 780

#: Width in pixels to which large pictures are reduced.
_WIDE_PX = 1600

#: Above this many structures the index leaves out the contact sheet (some 3 kB each).
_THUMBS_BELOW = 1000


@dataclass
class StructureView:
    """One structure as the templates see it."""

    case: str
    organ: str
    id: str
    metrics: dict[str, Any]
    headlines: list[dict[str, str]]
    warnings: list[str]
    picture: str | None
    renderer: str | None
    link: str
    sources: list[dict[str, Any]]
    provenance: str | None
    grid: str | None
    scene: Scene | None = None

    @property
    def name(self) -> str:
        """``case / organ`` for headings and alternative texts."""
        return f"{self.case} / {self.organ}"

    @property
    def measured(self) -> list[tuple[str, str]]:
        """Every number of metrics.json, in words."""
        return [(key, number(value)) for key, value in _flat(self.metrics).items()]


@dataclass
class ExhibitView:
    """One table or figure of the paper with ours beside it; a figure is (SVG, caption, is it wide)."""

    paper: Exhibit
    verdict: str | None
    table: Table | None
    figures: list[tuple[Markup, str, bool]]
    missing: str | None


def build_report(
    results: Path,
    structures: Sequence[tuple[str, str]],
    failures: Sequence[str],
    config: Mapping[str, Any],
    output: Path,
    benchmarks: Path | None,
    template_dir: Path,
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
        The configuration as merged; its section ``report`` holds ``pages_above`` and ``viewer_triangles``.
    output : path
        Where the page goes.
    benchmarks : path or None
        Folder of Snakemake's benchmark files.
    template_dir : path
        ``workflow/report``.
    """
    settings = config["report"]
    index = len(structures) > settings["pages_above"]
    width = _THUMB_WIDTH if index else _CARD_WIDTH
    thumbs = len(structures) <= _THUMBS_BELOW
    views = [
        _structure_view(results, output.parent, case, organ, width if thumbs else None)
        for case, organ in structures
    ]
    if not index:
        for view in views:
            view.scene = build_scene(results / view.case / view.organ, settings["viewer_triangles"])
    times = benchmark_table(benchmarks)
    history = read_csv(results / "gnn" / "history.csv")
    evidence = Evidence(results, structures, config)
    remarks = exhibits.remarks(evidence) | _read_json(results / "tables" / "remarks.json")
    _write(
        output,
        template_dir,
        "report.html.j2",
        {
            "title": "CCCD report",
            "index": index,
            "structures": views,
            "failures": list(failures),
            "measured": _measured_table(results, views, index),
            "cohort_plots": _cohort_plots(views) if index else [],
            "exhibits": [_exhibit(exhibit, evidence, remarks) for exhibit in EXHIBITS],
            "experiments": _experiments(evidence, views, remarks),
            "history": table("history", history) if history is not None else None,
            "learning": _markup(figures.learning_curve(history)) if history is not None else None,
            "training": _training_facts(results, config, history),
            "times": table("rule_times", times) if times is not None else None,
            "times_plot": Markup(figures.rule_times(times)) if times is not None else None,
            "total_time": duration(float(times["total_s"].sum())) if times is not None else None,
            "sources": _source_table(views),
            "worst": _picture(results / "gnn" / "worst.png", _WIDE_PX)
            if (results / "gnn" / "worst.png").is_file()
            else None,
            **_shared(config),
        },
    )


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
    view = _structure_view(results, output.parent, case, organ, _CARD_WIDTH)
    view.scene = build_scene(results / case / organ, config["report"]["viewer_triangles"])
    comparisons = []
    for path in sorted((results / case / organ / "comparisons").glob("*.csv")):
        frame = read_csv(path)
        if frame is not None:
            comparisons.append((words(path.stem)[0], table(path.stem, frame)))
    _write(
        output,
        template_dir,
        "structure.html.j2",
        {
            "title": f"{case} / {organ}",
            "structure": view,
            "back": _relative(index, output.parent) if index is not None else None,
            "comparisons": comparisons,
            **_shared(config),
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


def _read_json(path: Path) -> dict[str, Any]:
    if not path.is_file():
        return {}
    return json.loads(path.read_text(encoding="utf-8"))


def _plain(value: Any) -> Any:
    """Copy as plain values, so that YAML writes no Python tags."""
    if isinstance(value, Mapping):
        return {str(key): _plain(part) for key, part in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(part) for part in value]
    return value if isinstance(value, (str, int, float, bool, type(None))) else str(value)


def _relative(path: Path, folder: Path) -> str:
    return Path(os.path.relpath(path, folder)).as_posix()


# Structures ---------------------------------------------------------------------------------------------


def _structure_view(results: Path, home: Path, case: str, organ: str, width: int | None) -> StructureView:
    folder = results / case / organ
    metrics = _read_json(folder / "metrics.json")
    picture, renderer = None, None
    if width is not None and (folder / "picture.png").is_file():
        picture, renderer = _picture(folder / "picture.png", width), picture_renderer(folder / "picture.png")
    facts: dict[str, Any] = {}
    warnings = list(metrics.get("warnings", []))
    grid = None
    if (folder / "structure.h5").is_file():
        frame, facts, noticed = read_structure_facts(folder / "structure.h5")
        warnings = warnings or noticed
        grid = (
            " × ".join(str(n) for n in frame.shape)
            + " voxels of "
            + " × ".join(number(x, 3) for x in frame.spacing)
            + " mm"
        )
    else:
        warnings.append("No structure.h5: this structure was not imported.")
    return StructureView(
        case=case,
        organ=organ,
        id=re.sub(r"[^A-Za-z0-9_-]", "-", f"{case}--{organ}"),
        metrics=metrics,
        headlines=_headlines(metrics),
        warnings=warnings,
        picture=picture,
        renderer=renderer,
        link=f"{case}/{organ}/report.html",
        sources=_sources(facts),
        provenance=json.dumps(facts, indent=2, sort_keys=True, ensure_ascii=False) if facts else None,
        grid=grid,
    )


def _headlines(metrics: Mapping[str, Any]) -> list[dict[str, str]]:
    found = []
    for headline in HEADLINES:
        value = headline.value(metrics)
        if value is not None:
            text = typeset(format(int(value) if headline.form == ",d" else value, headline.form))
            found.append({"heading": headline.heading, "text": text, "unit": headline.unit})
    return found


def _picture(path: Path, width: int) -> str:
    """Encode a picture as base64 WebP at most ``width`` pixels wide, transparency kept."""
    from PIL import Image

    with Image.open(path) as opened:
        picture = opened.convert("RGBA")
    picture.thumbnail((width, width))
    buffer = io.BytesIO()
    picture.save(buffer, "WEBP", quality=80, method=4)
    return base64.b64encode(buffer.getvalue()).decode("ascii")


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


def _source_table(views: Sequence[StructureView]) -> Table | None:
    rows = [{"structure": view.name, **source} for view in views for source in view.sources]
    return table("inputs", pd.DataFrame(rows)) if rows else None


def _flat(metrics: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Numbers of nested metrics under dotted names; lists and texts are left out."""
    found: dict[str, Any] = {}
    for key, value in metrics.items():
        if isinstance(value, Mapping):
            found |= _flat(value, f"{prefix}{key} ")
        elif isinstance(value, (int, float)):
            found[f"{prefix}{key}"] = value
    return found


def _measured_table(results: Path, views: Sequence[StructureView], index: bool) -> Table | None:
    """``tables/structures.csv``, or the headlines of every structure while it is not there."""
    frame = read_csv(results / "tables" / "structures.csv")
    if frame is None:
        rows = [
            {"case": view.case, "organ": view.organ}
            | {headline.label: headline.value(view.metrics) for headline in HEADLINES}
            | {"warnings": len(view.warnings)}
            for view in views
        ]
        frame = pd.DataFrame(rows)
    if frame.empty:
        return None
    links = None
    if {"case", "organ"}.issubset(frame.columns):
        paged = {(view.case, view.organ): view for view in views}
        keys = zip(frame["case"].astype(str), frame["organ"].astype(str), strict=True)
        targets = {key: view.link if index else f"#{view.id}" for key, view in paged.items()}
        links = [targets.get(key) for key in keys]
    return table("structures", frame, links)


def _cohort_plots(views: Sequence[StructureView]) -> list[Markup]:
    frame = pd.DataFrame(
        [
            {"organ": view.organ} | {headline.label: headline.value(view.metrics) for headline in HEADLINES}
            for view in views
        ]
    )
    labels = [headline.label for headline in HEADLINES]
    return [Markup(plot) for plot in figures.strips(frame, labels, "organ")]


# Tables and figures -------------------------------------------------------------------------------------


def _exhibit(exhibit: Exhibit, evidence: Evidence, remarks: Mapping[str, Any]) -> ExhibitView:
    shown = evidence.table(exhibit.table) if exhibit.table is not None else None
    drawn = exhibits.plots(exhibit.key, evidence)
    missing = None
    if exhibit.table is not None and shown is None:
        missing = f"tables/{exhibit.table}.csv is not there: this run did not make it."
    elif shown is None and not drawn and exhibit.key not in remarks:
        missing = "This run made no comparison for it."
    return ExhibitView(
        exhibit,
        remarks.get(exhibit.key),
        table(exhibit.table, shown) if shown is not None else None,
        [(svg, caption, _width(svg) > _COLUMN_PX) for svg, caption in drawn],
        missing,
    )


def _width(svg: str) -> float:
    """Read the natural width of a plot in CSS pixels."""
    return float(re.search(r"max-width: (\d+)px", svg)[1])


class Experiment(NamedTuple):
    """A table that goes past the paper and what draws it."""

    stem: str
    title: str
    text: str
    draw: Callable[[Evidence], list[tuple[Markup, str]]] | None = None


EXPERIMENTS = (
    Experiment(
        "surfaces",
        "Against the surfaces people use today",
        "Every method on the same structures, measured alike.",
        exhibits.surfaces,
    ),
    Experiment(
        "thick_slices",
        "Thick slices",
        "Every n-th slice is kept, the surface is rebuilt from those and compared with the full resolution.",
        exhibits.thick_slices,
    ),
    Experiment(
        "junctions",
        "Junction repair",
        "Boundary maps with spurs, bridges, gaps and noise, ordered by the network and by the classical "
        "decoders.",
        exhibits.junctions,
    ),
    Experiment(
        "ordering",
        "Isolated corners, before and after",
        "Where a greedy chain code gets stuck on the boundary pixels (Figure 4), and on the ordered curves.",
    ),
    Experiment(
        "compactness",
        "Compactness",
        "Bytes per slice of the splines (control points, knots, header), the chain code, the PNG and the raw "
        "contour.",
    ),
    Experiment("k_sweep", "The whole sweep over k", "Every structure, both criteria."),
)


def _experiments(
    evidence: Evidence, views: Sequence[StructureView], remarks: Mapping[str, Any]
) -> list[dict[str, Any]]:
    """Collect the tables that go past the paper, each with its plots."""
    found = []
    for experiment in EXPERIMENTS:
        frame = evidence.everywhere(experiment.stem)
        drawn = experiment.draw(evidence) if experiment.draw else []
        if experiment.stem == "ordering":
            frame = _ordering(views)
        if experiment.stem == "compactness":
            frame = _sizes(views) if frame is None else frame
            drawn = exhibits.compactness(frame) if frame is not None else []
        found.append(
            {
                "key": experiment.stem,
                "title": experiment.title,
                "text": experiment.text,
                "figures": drawn,
                "table": table(experiment.stem, frame) if frame is not None else None,
                "verdict": remarks.get(experiment.stem),
            }
        )
    return found


def _ordering(views: Sequence[StructureView]) -> pd.DataFrame | None:
    """Take what the ordering stage counted, one row per structure, out of the metrics."""
    rows = []
    for view in views:
        counted = view.metrics.get("ordering", {})
        row = {key: value for key, value in counted.items() if isinstance(value, (int, float, str))}
        agreement = counted.get("gnn_agreement")
        if isinstance(agreement, Mapping) and "dice" in agreement:
            row["GNN against exact tracing, Dice"] = agreement["dice"]
        if row:
            rows.append({"case": view.case, "organ": view.organ, **row})
    return pd.DataFrame(rows) if rows else None


def _sizes(views: Sequence[StructureView]) -> pd.DataFrame | None:
    """Bytes per slice of every way to keep the contours, out of the metrics of the curves."""
    rows = [
        {"case": view.case, "organ": view.organ, **view.metrics.get("curves", {}).get("bytes_per_slice", {})}
        for view in views
    ]
    frame = pd.DataFrame(rows)
    return frame if frame.shape[1] > 2 else None


def _training_facts(results: Path, config: Mapping[str, Any], history: pd.DataFrame | None) -> dict[str, str]:
    """Collect data counts, seed, device and time, as far as the training left them."""
    found = {"seed": str(config.get("seed", "not set"))}
    pretrained = (config.get("gnn") or {}).get("pretrained")
    if pretrained:
        found["weights"] = f"not trained here, taken from {pretrained}"
    elif history is not None and {"device", "seconds"}.issubset(history.columns):
        found["device"] = "; ".join(history["device"].astype(str).unique())
        found["epochs"] = f"{len(history)} in {duration(float(history['seconds'].sum()))}"
    path = results / "gnn" / "graphs.h5"
    if path.is_file():
        with h5py.File(path, "r", locking=False) as file:
            splits = [f"{len(file[name]['kind'])} {name}" for name in ("training", "validation", "test")]
            facts = dict(file.attrs)
        found["frozen graphs"] = ", ".join(splits)
        found["kinds of damage"] = facts["kinds"].replace(",", ", ").replace("_", " ")
        for name, key in (("size of the graphs", "bytes"), ("209 graphs of 1917 nodes", "bytes_paper")):
            sparse, dense = facts[key], facts[f"{key}_dense"]
            found[name] = (
                f"{number(sparse / 1e6, 1)} MB; as dense matrices {number(dense / 1e9, 2)} GB, "
                f"{number(dense / sparse, 0)} times as much"
            )
    return found
