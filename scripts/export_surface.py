"""Write the surface in another format."""

from cccd.job import job
from cccd.surface.export import read_surface, write_surface

with job(snakemake.log[0], "{case}/{organ}".format(**snakemake.wildcards)):
    surface = read_surface(snakemake.input.surface, snakemake.input.mesh)
    write_surface(snakemake.output[0], surface)
