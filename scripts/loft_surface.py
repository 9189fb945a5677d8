"""Loft the curves of one structure into a closed spline surface, or take it out of shared walls."""

from cccd.geometry.ply import write_ply
from cccd.job import job
from cccd.settings.formats import NOTE
from cccd.settings.surface import LoftSettings
from cccd.solids.shared_walls import take_organ
from cccd.store import atomic_path, read_sections, write_control_meshes
from cccd.surface import loft_surface

with job(snakemake.log[0], "{case}/{organ}".format(**snakemake.wildcards), snakemake.input, snakemake.output):
    settings, walls = LoftSettings(**snakemake.params.settings), snakemake.input.get("walls")
    surface = None if walls is None else take_organ(walls, snakemake.input.structure, settings)
    if surface is None:
        surface = loft_surface(read_sections(snakemake.input.curves, snakemake.input.structure), settings)
    band = (surface.band, surface.vertices)
    write_control_meshes(snakemake.output.surface, surface.bodies, surface.frame, surface.report, band)
    with atomic_path(snakemake.output.mesh) as path:
        write_ply(path, surface.mesh, NOTE)
