"""Curve reconstruction from points, on one structure."""

from cccd.comparisons.reconstruction_comparison import compare_reconstruction
from cccd.job import job
from cccd.junctions import load_model
from cccd.store import read_curves, read_structure, write_table

with job(snakemake.log[0], "{case}/{organ}".format(**snakemake.wildcards)):
    table = compare_reconstruction(
        read_structure(snakemake.input.structure),
        read_curves(snakemake.input.curves),
        snakemake.params.settings,
        snakemake.params.seed,
        model=load_model(snakemake.input.model),
    )
    write_table(snakemake.output[0], table)
