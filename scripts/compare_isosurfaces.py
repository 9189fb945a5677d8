"""Marching cubes and its kin beside our surface, on one structure."""

from cccd.comparisons.isosurfaces import compare_isosurfaces
from cccd.job import job
from cccd.store import read_curves, read_structure, write_table
from cccd.surface.export import read_surface

with job(snakemake.log[0], "{case}/{organ}".format(**snakemake.wildcards)):
    table = compare_isosurfaces(
        read_structure(snakemake.input.structure),
        read_curves(snakemake.input.curves),
        read_surface(snakemake.input.surface, snakemake.input.mesh),
        snakemake.params.settings,
    )
    write_table(snakemake.output[0], table)
