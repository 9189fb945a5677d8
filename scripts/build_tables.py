"""Every table over the whole cohort, the paper's numbers beside ours, and a note on each."""

from pathlib import Path

from cccd.job import job
from cccd.report.summary import build_tables, read_cohort, write_notes
from cccd.store import write_json, write_table

with job(snakemake.log[0], "tables", snakemake.input, snakemake.output):
    cohort = read_cohort(snakemake.input.comparisons, snakemake.input.metrics, snakemake.input.distances)
    tables = build_tables(cohort)
    for output in snakemake.output.tables:
        write_table(output, tables[Path(output).stem])
    write_json(snakemake.output.notes, write_notes(cohort))
