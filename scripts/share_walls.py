"""Smooth the organs of one case together: each wall between two of them is one surface."""

from cccd.job import job
from cccd.solids.shared_walls import read_organs, share_walls
from cccd.store import write_conforming

with job(snakemake.log[0], snakemake.wildcards.case, snakemake.input, snakemake.output):
    organs = read_organs(snakemake.input.structures, snakemake.input.meshes)
    shared = share_walls(organs)
    write_conforming(snakemake.output[0], shared.surface, shared.report())
