"""Find the boundary pixels of every slice."""

from cccd.job import job
from cccd.settings.boundaries import BoundarySettings
from cccd.store import read_structure, write_boundaries
from cccd_junctions.boundary import extract_boundaries

with job(snakemake.log[0], "{case}/{organ}".format(**snakemake.wildcards), snakemake.input, snakemake.output):
    structure = read_structure(snakemake.input.structure)
    settings = BoundarySettings(**snakemake.params.settings)
    write_boundaries(snakemake.output[0], extract_boundaries(structure, settings))
