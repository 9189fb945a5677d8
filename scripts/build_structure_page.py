"""One structure's own page."""

from pathlib import Path

from cccd.job import job
from cccd.report.page import build_structure_page

case, organ = snakemake.wildcards.case, snakemake.wildcards.organ
with job(snakemake.log[0], f"{case}/{organ}", snakemake.input, snakemake.output):
    results = Path(snakemake.output[0]).parents[2]
    build_structure_page(
        results,
        case,
        organ,
        config=snakemake.params.config,
        output=Path(snakemake.output[0]),
        template_dir=Path(snakemake.scriptdir).parent / "workflow" / "report",
        index=results / "report.html",
    )
