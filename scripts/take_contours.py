"""Take drawn contours as they are."""

from cccd.contours import take_contours
from cccd.job import job
from cccd.store import read_structure, write_contours

with job(snakemake.log[0], "{case}/{organ}".format(**snakemake.wildcards), snakemake.input, snakemake.output):
    write_contours(snakemake.output[0], *take_contours(read_structure(snakemake.input.structure)))
