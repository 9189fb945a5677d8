"""Fit one spline to the walls of a case's organs that touch."""

from pathlib import Path

from cccd.surface.surface import read_surface
from cccd_walls.files import write_spline
from cccd_walls.splines import fit_organs
from cccd_workflow.job import job

with job(snakemake.log[0], snakemake.wildcards.case, snakemake.input, snakemake.output):
    surfaces = {
        Path(mesh).parent.name: read_surface(path, mesh)
        for path, mesh in zip(snakemake.input.surfaces, snakemake.input.meshes, strict=True)
    }
    spline = fit_organs(surfaces, snakemake.params.tolerance_mm)
    frame = next(iter(surfaces.values())).frame
    write_spline(snakemake.output[0], spline, frame, {"tolerance_mm": snakemake.params.tolerance_mm})
