"""One table of all phantoms, beside the words that say what they are and how they may be used."""

import shutil

from cccd.store import write_table
from cccd_paper.phantom_files import gather_tables
from cccd_workflow.job import job

with job(snakemake.log[0], "phantoms", snakemake.input, snakemake.output):
    write_table(snakemake.output.table, gather_tables(snakemake.input.tables))
    shutil.copyfile(snakemake.input.text, snakemake.output.text)
    shutil.copyfile(snakemake.input.licence, snakemake.output.licence)
