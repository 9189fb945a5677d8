"""A page that shows all organs of a case."""

from pathlib import Path

from cccd.store import read_json, read_ply
from cccd_workflow.job import job
from cccd_workflow.report.page import build_case_page
from cccd_workflow.stage_files import by_organ

with job(snakemake.log[0], snakemake.wildcards.case, snakemake.input, snakemake.output):
    build_case_page(
        read_json(snakemake.input.scene),
        by_organ(read_ply, snakemake.input.meshes),
        Path(snakemake.input.template).parent,
        Path(snakemake.output[0]),
    )
