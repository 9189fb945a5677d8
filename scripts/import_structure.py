"""Read one structure of the cohort sheet into structure.h5."""

from pathlib import Path

from cccd.job import job
from cccd.store import write_structure
from cccd.volumes import load_structure

row = snakemake.params.row
name = f"{row['case']}/{row['organ']}"
with job(snakemake.log[0], name):
    place = f"{snakemake.params.sheet_name} {name}"
    settings = {**snakemake.params.settings, "seed": snakemake.params.seed}
    structure = load_structure({**row, "place": place}, Path(snakemake.params.sheet_folder), settings)
    write_structure(snakemake.output[0], structure)
