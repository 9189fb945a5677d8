"""Sweep k and both criteria of the k-cosine corners."""

from cccd.curves import sweep_k
from cccd.job import job
from cccd.store import read_curves, read_structure, write_table

with job(snakemake.log[0], "{case}/{organ}".format(**snakemake.wildcards)):
    structure = read_structure(snakemake.input.structure)
    curves = read_curves(snakemake.input.curves)
    table = sweep_k(curves, structure.stack("mask"), structure.stack_origin, ks=snakemake.params.ks)
    write_table(snakemake.output[0], table)
