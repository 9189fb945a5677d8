"""Read one structure of the cohort sheet into structure.h5."""

from pathlib import Path

from cccd.cohort import read_cohort
from cccd.job import job
from cccd.settings import ImportSettings
from cccd.store import write_structure
from cccd.volumes import load_structure

row = snakemake.params.row
key = row["case"], row["organ"]
with job(snakemake.log[0], "/".join(key)):
    folder = Path(snakemake.params.sheet_folder)
    sheet = read_cohort(folder / snakemake.params.sheet_name)
    (location,) = (other["location"] for other in sheet if (other["case"], other["organ"]) == key)
    settings = ImportSettings(**snakemake.params.settings)
    structure = load_structure({**row, "location": location}, folder, settings, snakemake.params.seed)
    write_structure(snakemake.output[0], structure)
