"""Draw the frozen synthetic junction graphs."""

from cccd_networks.settings import GraphSettings
from cccd_training.junctions.frozen_graphs import generate_graphs
from cccd_workflow.job import job

with job(snakemake.log[0], "training graphs", snakemake.input, snakemake.output):
    settings = GraphSettings(**snakemake.params.settings)
    generate_graphs(settings, snakemake.params.seed, snakemake.output[0])
