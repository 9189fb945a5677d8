"""Every table over the whole cohort."""

from pathlib import Path

from cccd.store import write_table
from cccd_workflow.job import job
from cccd_workflow.report.summary import build_tables, read_cohort

with job(snakemake.log[0], "tables", snakemake.input, snakemake.output):
    cohort = read_cohort(snakemake.input.comparisons, snakemake.input.metrics, snakemake.input.distances)
    tables = build_tables(cohort)
    for output in snakemake.output:
        write_table(output, tables[Path(output).stem])
