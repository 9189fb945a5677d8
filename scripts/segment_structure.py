"""Segment one scan that has no mask: labels and probabilities on its own grid."""

from pathlib import Path

from cccd.settings.imports import ImportSettings
from cccd_datasets.whole_scans import read_scan
from cccd_segmentation.segment import segment, write_segmentation
from cccd_workflow.job import job

with job(snakemake.log[0], "{case}/{organ}".format(**snakemake.wildcards), snakemake.input, snakemake.output):
    row, reading = snakemake.params.row, ImportSettings(**snakemake.params.reading)
    image = read_scan(row, Path(snakemake.params.sheet_folder), reading, snakemake.params.seed)
    found = segment(image, snakemake.input.model or snakemake.params.segmenter, row["organ"])
    write_segmentation(found, *snakemake.output)
