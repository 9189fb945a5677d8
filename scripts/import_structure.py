"""Read one structure of the cohort sheet into structure.h5."""

from pathlib import Path

from cccd.cohort import naming_row
from cccd.job import job
from cccd.settings.imports import ImportSettings
from cccd.store import write_structure
from cccd.volumes import load_structure

row = snakemake.params.row
name = f"{row['case']}/{row['organ']}"
folder = Path(snakemake.params.sheet_folder)
with job(snakemake.log[0], name), naming_row(folder / snakemake.params.sheet_name, name):
    settings = ImportSettings(**snakemake.params.settings)
    structure = load_structure({**row, "location": name}, folder, settings, snakemake.params.seed)
    write_structure(snakemake.output[0], structure)
