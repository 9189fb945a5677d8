"""Read one structure of the cohort sheet into structure.h5."""

from pathlib import Path

from cccd.cohort import naming_row
from cccd.inputs import load_structure
from cccd.inputs.load import with_segmentation_notes
from cccd.job import job
from cccd.settings.imports import ImportSettings
from cccd.store import read_json, write_structure

row = snakemake.params.row
name = f"{row['case']}/{row['organ']}"
folder = Path(snakemake.params.sheet_folder)
with (
    job(snakemake.log[0], name, snakemake.input, snakemake.output),
    naming_row(folder / snakemake.params.sheet_name, name),
):
    settings = ImportSettings(**snakemake.params.settings)
    structure = load_structure({**row, "location": name}, folder, settings, snakemake.params.seed)
    for report in snakemake.input.segmentation[1:]:  # of a mask that a segmenter made
        structure = with_segmentation_notes(structure, read_json(report))
    write_structure(snakemake.output[0], structure)
