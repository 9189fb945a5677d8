"""Trace the borders of a mask's slices: no network, no model."""

from cccd.contours import trace_contours
from cccd.job import job
from cccd.store import read_structure, write_contours

with job(snakemake.log[0], "{case}/{organ}".format(**snakemake.wildcards), snakemake.input, snakemake.output):
    write_contours(snakemake.output[0], *trace_contours(read_structure(snakemake.input.structure)))
