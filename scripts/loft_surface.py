"""Loft the curves of one structure into a closed spline surface."""

from cccd.geometry.ply import write_ply
from cccd.job import job
from cccd.settings.formats import NOTE
from cccd.settings.surface import LoftSettings
from cccd.store import (
    atomic_path,
    read_annotation,
    read_curves,
    read_probability,
    read_splines,
    write_control_meshes,
)
from cccd.surface import loft_surface

with job(snakemake.log[0], "{case}/{organ}".format(**snakemake.wildcards), snakemake.input, snakemake.output):
    curves = read_curves(snakemake.input.curves)
    splines = read_splines(snakemake.input.curves)
    settings = LoftSettings(**snakemake.params.settings)
    known = snakemake.input.structure
    surface = loft_surface(curves, settings, splines, read_probability(known), read_annotation(known))
    band = (surface.band, surface.vertices)
    write_control_meshes(snakemake.output.surface, surface.bodies, surface.frame, surface.report, band)
    with atomic_path(snakemake.output.mesh) as path:
        write_ply(path, surface.mesh, NOTE)
