"""Take a trained model that the configuration names, after checking that it loads."""

import shutil

from cccd.store import atomic_path
from cccd_junctions.checkpoint import load_model
from cccd_workflow.job import job

with job(snakemake.log[0], "pretrained GNN", snakemake.input, snakemake.output):
    load_model(snakemake.input.model)
    with atomic_path(snakemake.output.model) as path:
        shutil.copyfile(snakemake.input.model, path)
