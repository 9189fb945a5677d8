"""A page that shows all organs of a case."""

from pathlib import Path

from cccd.store import read_json, read_ply
from cccd_workflow.job import job
from cccd_workflow.report.page import build_case_page

with job(snakemake.log[0], snakemake.wildcards.case, snakemake.input, snakemake.output):
    build_case_page(
        read_json(snakemake.input.scene),
        {Path(path).parent.name: read_ply(path) for path in snakemake.input.meshes},
        Path(snakemake.input.template).parent,
        Path(snakemake.output[0]),
    )
