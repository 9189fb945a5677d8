"""A picture of the surface."""

import logging

from cccd.job import job
from cccd.report.render import render_surface

with job(snakemake.log[0], "{case}/{organ}".format(**snakemake.wildcards), snakemake.input, snakemake.output):
    way = render_surface(snakemake.input.mesh, snakemake.output[0])
    logging.info("drawn with %s", way)
