"""Sweep k and both criteria of the k-cosine corners."""

from cccd.curves import sweep_k
from cccd.job import job
from cccd.store import read_curves, write_table

with job(snakemake.log[0], "{case}/{organ}".format(**snakemake.wildcards)):
    write_table(snakemake.output[0], sweep_k(read_curves(snakemake.input.curves), **snakemake.params.sweep))
