"""Train a junction GNN, ours or the paper's, from its last checkpoint if there is one."""

from cccd_networks.settings import NetworkSettings
from cccd_training.junctions.loop import train_model
from cccd_workflow.job import job

with job(snakemake.log[0], "GNN training", snakemake.input, snakemake.output):
    start = snakemake.input.start[0] if snakemake.input.start else None
    train_model(
        snakemake.input.graphs,
        NetworkSettings(**snakemake.params.settings, start=start),
        seed=snakemake.params.seed,
        checkpoint_dir=snakemake.params.checkpoints,
        model_path=snakemake.output.model,
        history_path=snakemake.output.history,
        threads=snakemake.threads,
    )
