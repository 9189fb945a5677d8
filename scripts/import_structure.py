"""Read one structure of the cohort sheet: what came in, its boundary pixels, and ordered contours."""

from pathlib import Path

from cccd.inputs import Request, read_request
from cccd.inputs.load import with_segmentation_notes
from cccd.plugins import call
from cccd.settings.imports import ImportSettings
from cccd.settings.junctions import BoundarySettings
from cccd.store import read_json, write_structure
from cccd_junctions.boundary import extract_boundaries
from cccd_viewers.regions import draw_region
from cccd_workflow.cohort import naming_row
from cccd_workflow.job import job
from cccd_workflow.stage_files import write_boundaries, write_contours

output, params = snakemake.output, snakemake.params
name = f"{params.row['case']}/{params.row['organ']}"
folder = Path(params.sheet_folder)
with (
    job(snakemake.log[0], name, snakemake.input, output),
    naming_row(folder / params.sheet_name, name),
):
    settings = ImportSettings(**params.settings)
    structure = read_request(Request.of_row({**params.row, "location": name}, folder), settings, params.seed)
    for report in snakemake.input.segmentation[1:]:  # of a mask that a segmenter made
        structure = with_segmentation_notes(structure, read_json(report))
    write_structure(output.structure, structure)
    boundaries = extract_boundaries(structure, BoundarySettings(**params.boundaries))
    write_boundaries(output.boundaries, boundaries)
    given = {"structure": structure, "boundaries": boundaries, "decoding": params.decoding}
    for model in snakemake.input.model:
        given["weights"] = model
    write_contours(output.contours, *call(params.way, given))
    if region := output.get("region"):
        draw_region(structure, region)
