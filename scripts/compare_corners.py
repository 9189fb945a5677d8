"""Pixel corner detectors fused with splines, on one structure."""

from cccd.comparisons.corner_comparison import compare_corners
from cccd.job import job
from cccd.store import read_curves, read_structure, write_table

with job(snakemake.log[0], "{case}/{organ}".format(**snakemake.wildcards)):
    structure = read_structure(snakemake.input.structure)
    curves = read_curves(snakemake.input.curves)
    table = compare_corners(structure, curves, snakemake.params.settings, snakemake.params.seed)
    write_table(snakemake.output[0], table)
