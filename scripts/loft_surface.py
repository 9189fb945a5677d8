"""Loft the contours of one structure into a closed spline surface."""

from cccd.settings.surface import LoftSettings
from cccd.surface.loft import loft_surface
from cccd.surface.surface import write_files
from cccd_workflow.job import job
from cccd_workflow.stage_files import read_sections

with job(snakemake.log[0], "{case}/{organ}".format(**snakemake.wildcards), snakemake.input, snakemake.output):
    sections = read_sections(snakemake.input.contours, snakemake.input.structure)
    surface = loft_surface(sections, LoftSettings(**snakemake.params.settings))
    write_files(surface, snakemake.output.surface, snakemake.output.mesh)
