"""Draw the frozen synthetic junction graphs."""

from cccd.job import job
from cccd.junctions.frozen_graphs import generate_graphs
from cccd.settings.junctions import NetworkSettings

with job(snakemake.log[0], "training graphs", snakemake.input, snakemake.output):
    settings = NetworkSettings(**snakemake.params.settings)
    generate_graphs(settings.graphs, settings.kind_weights, snakemake.params.seed, snakemake.output[0])
