"""Take the surface of one structure out of shared walls, or loft it where it touches nothing."""

from cccd.settings.surface import LoftSettings
from cccd.surface.loft import loft_surface
from cccd.surface.surface import write_files
from cccd_labels.shared_walls import take_organ
from cccd_workflow.job import job
from cccd_workflow.stage_files import read_sections

with job(snakemake.log[0], "{case}/{organ}".format(**snakemake.wildcards), snakemake.input, snakemake.output):
    settings = LoftSettings(**snakemake.params.settings)
    surface = take_organ(snakemake.input.walls, snakemake.input.structure, settings)
    if surface is None:
        surface = loft_surface(read_sections(snakemake.input.contours, snakemake.input.structure), settings)
    write_files(surface, snakemake.output.surface, snakemake.output.mesh)
