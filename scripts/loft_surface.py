"""Loft the curves of one structure into a closed spline surface."""

from cccd.geometry.ply import write_ply
from cccd.job import job
from cccd.settings.formats import NOTE
from cccd.settings.surface import LoftSettings
from cccd.store import atomic_path, read_sections, write_control_meshes
from cccd.surface import loft_surface

with job(snakemake.log[0], "{case}/{organ}".format(**snakemake.wildcards), snakemake.input, snakemake.output):
    sections = read_sections(snakemake.input.curves, snakemake.input.structure)
    surface = loft_surface(sections, LoftSettings(**snakemake.params.settings))
    band = (surface.band, surface.vertices)
    write_control_meshes(snakemake.output.surface, surface.bodies, surface.frame, surface.report, band)
    with atomic_path(snakemake.output.mesh) as path:
        write_ply(path, surface.mesh, NOTE)
