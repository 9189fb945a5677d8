"""Score the GNN and the classical decoders on the same corrupted maps."""

from cccd_paper.comparisons.junction_comparison import evaluate
from cccd_workflow.job import job

with job(snakemake.log[0], "GNN evaluation", snakemake.input, snakemake.output):
    evaluate(
        dict(zip(snakemake.params.names, snakemake.input.models, strict=True)),
        snakemake.params.settings,
        snakemake.params.seed,
        snakemake.output.scores,
        snakemake.output.worst,
    )
