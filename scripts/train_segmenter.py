"""Train a segmentation network on the sheet's training rows, from its last checkpoint if there is one."""

from pathlib import Path

from cccd.settings.imports import ImportSettings
from cccd.store import write_table
from cccd_segmentation.model import save_segmenter
from cccd_segmentation.settings import SegmentationSettings
from cccd_training.segmentation.curve import draw_learning_curve
from cccd_training.segmentation.scans import read_labelled_scan
from cccd_training.segmentation.training import score_held_out, train_segmenter
from cccd_workflow.job import job

with job(snakemake.log[0], f"segmenter {snakemake.wildcards.network}", snakemake.input, snakemake.output):
    settings = SegmentationSettings(**snakemake.params.settings)
    reading, rows = ImportSettings(**snakemake.params.reading), snakemake.params.rows
    folder, seed = Path(snakemake.params.sheet_folder), snakemake.params.seed
    scans = [read_labelled_scan(row, folder, reading, settings.labels, seed) for row in rows]
    trained = train_segmenter(
        scans,
        snakemake.wildcards.network,
        settings,
        seed,
        snakemake.params.checkpoints,
        organ=" ".join(sorted({row["organ"] for row in rows})),
        threads=snakemake.threads,
    )
    save_segmenter(snakemake.output.model, trained.model, trained.plan)
    write_table(snakemake.output.history, trained.history)
    write_table(snakemake.output.scores, score_held_out(snakemake.output.model, scans, settings, seed))
    draw_learning_curve(snakemake.output.curve, trained.history)
