"""Loft the curves of one structure into a closed spline surface."""

from cccd.geometry.ply import write_ply
from cccd.job import job
from cccd.settings.formats import NOTE
from cccd.settings.surface import LoftSettings
from cccd.store import atomic_path, read_json, read_sections, write_control_meshes
from cccd.surface import loft_before_walls, loft_surface

with job(snakemake.log[0], "{case}/{organ}".format(**snakemake.wildcards), snakemake.input, snakemake.output):
    sections = read_sections(snakemake.input.curves, snakemake.input.structure)
    neighbours = snakemake.input.get("neighbours")
    shares = neighbours is not None and snakemake.wildcards.organ in read_json(neighbours)["sharing"]
    loft = loft_before_walls if shares else loft_surface
    surface = loft(sections, LoftSettings(**snakemake.params.settings))
    band = (surface.band, surface.vertices)
    write_control_meshes(snakemake.output.surface, surface.bodies, surface.frame, surface.report, band)
    with atomic_path(snakemake.output.mesh) as path:
        write_ply(path, surface.mesh, NOTE)
