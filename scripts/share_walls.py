"""Smooth the organs of one case together that touch: each wall between two of them is one surface."""

from cccd.settings.surface import LoftSettings
from cccd_labels.conforming import write_conforming
from cccd_labels.shared_walls import read_structures, share_walls
from cccd_workflow.job import job

with job(snakemake.log[0], snakemake.wildcards.case, snakemake.input, snakemake.output):
    structures = read_structures(snakemake.input.structures)
    shared = share_walls(structures, LoftSettings(**snakemake.params.settings))
    write_conforming(snakemake.output[0], shared.surface, shared.report())
