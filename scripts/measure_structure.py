"""Everything measured on one structure, a picture of its surface, and its page."""

import logging
from pathlib import Path

from cccd.store import read_json, read_report, read_structure, write_json
from cccd.surface.surface import read_surface
from cccd_viewers.page_files import write_view
from cccd_workflow.curve_measures import doubtful_slices, measure_curves
from cccd_workflow.job import job
from cccd_workflow.report.render import render_surface
from cccd_workflow.report.structure_view import build_structure_page
from cccd_workflow.stage_files import read_boundaries, read_curves, read_splines
from cccd_workflow.surface_measures import measure_surface, volume_warnings
from cccd_workflow.view import make_view

#: Slices to annotate next that are named.
NAMED = 5

name = "{case}/{organ}".format(**snakemake.wildcards)
with job(snakemake.log[0], name, snakemake.input, snakemake.output):
    structure = read_structure(snakemake.input.structure)
    curves, splines = read_curves(snakemake.input.curves), read_splines(snakemake.input.curves)
    surface = read_surface(snakemake.input.surface, snakemake.input.mesh)
    ordering, fitting = read_report(snakemake.input.contours), read_report(snakemake.input.curves)
    solids = {report["format"]: report for report in map(read_json, snakemake.input.solids)}
    volumes = [*map(read_json, snakemake.input.volume)]
    figures = measure_surface(surface, structure)
    metrics = {
        "case": structure.case,
        "organ": structure.organ,
        "curves": {**measure_curves(curves, splines), "mended": fitting["mended"]},
        "surface": figures,
        "ordering": {key: value for key, value in ordering.items() if key != "slices"},
        "warnings": [
            *structure.warnings,
            *doubtful_slices(ordering),
            *fitting["warnings"],
            *surface.report["warnings"],
            *volume_warnings(figures),
            *(warning for report in (*solids.values(), *volumes) for warning in report["warnings"]),
        ],
    }
    if structure.annotation is not None:
        gaps = structure.annotation.gaps[:NAMED]
        metrics["next_slices"] = [{"slice": number, "gap": gap} for number, gap in gaps]
    if solids:
        metrics["solids"] = {
            name: {key: value for key, value in report.items() if key not in {"format", "warnings"}}
            for name, report in solids.items()
        }
    for report in volumes:
        metrics["tetrahedra"] = {"seconds": report["seconds"], **report["organs"][structure.organ]}
    write_json(snakemake.output.metrics, metrics)
    boundaries = read_boundaries(snakemake.input.boundaries)
    view = make_view(structure, boundaries, curves, surface.mesh, surface.band)
    write_view(snakemake.output.view, view)
with job(snakemake.log[0], f"{name}, picture", snakemake.input, snakemake.output):
    logging.info("drawn with %s", render_surface(snakemake.input.mesh, snakemake.output.picture))
with job(snakemake.log[0], f"{name}, page", snakemake.input, snakemake.output):
    page = Path(snakemake.output.page)
    results = page.parents[2]
    build_structure_page(
        results,
        structure.case,
        structure.organ,
        config=snakemake.params.config,
        output=page,
        template_dir=Path(snakemake.scriptdir).parent / "workflow" / "report",
        index=results / "report.html",
    )
