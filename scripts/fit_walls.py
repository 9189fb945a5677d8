"""Fit one spline to the walls of a case's organs that touch."""

from cccd.surface.surface import read_surface
from cccd_walls.files import write_spline
from cccd_walls.splines import fit_organs
from cccd_workflow.job import job
from cccd_workflow.stage_files import by_organ

with job(snakemake.log[0], snakemake.wildcards.case, snakemake.input, snakemake.output):
    surfaces = by_organ(read_surface, snakemake.input.surfaces, snakemake.input.meshes)
    spline = fit_organs(surfaces, snakemake.params.tolerance_mm)
    frame = next(iter(surfaces.values())).frame
    write_spline(snakemake.output[0], spline, frame, {"tolerance_mm": snakemake.params.tolerance_mm})
