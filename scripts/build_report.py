"""The report: the cohort's page."""

from pathlib import Path

from cccd_workflow.job import job
from cccd_workflow.report.page import build_report

with job(snakemake.log[0], "report", snakemake.input, snakemake.output):
    output = Path(snakemake.output[0])
    build_report(
        results=output.parent,
        structures=[tuple(key) for key in snakemake.params.structures],
        failures=[],
        config=snakemake.params.config,
        output=output,
        benchmarks=Path(snakemake.params.benchmarks),
        template_dir=Path(snakemake.scriptdir).parent / "workflow" / "report",
    )
