"""A picture of what was taken from an image that came without a mask."""

from cccd.inputs.regions import draw_region
from cccd.job import job
from cccd.store import read_structure

with job(snakemake.log[0], "{case}/{organ}".format(**snakemake.wildcards), snakemake.input, snakemake.output):
    draw_region(read_structure(snakemake.input.structure), snakemake.output[0])
