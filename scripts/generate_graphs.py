"""Draw the frozen synthetic junction graphs."""

from cccd.job import job
from cccd.junctions.frozen_graphs import generate_graphs

with job(snakemake.log[0], "training graphs"):
    generate_graphs(snakemake.params.settings, snakemake.params.seed, snakemake.output[0])
