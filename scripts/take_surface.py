"""One organ's closed surface out of those of its case that share their walls."""

from cccd.geometry.ply import write_ply
from cccd.job import job
from cccd.settings.formats import NOTE
from cccd.solids.shared_walls import surface_of
from cccd.store import atomic_path, read_conforming

case, organ = snakemake.wildcards.case, snakemake.wildcards.organ
with job(snakemake.log[0], f"{case}/{organ}", snakemake.input, snakemake.output):
    mesh = surface_of(read_conforming(snakemake.input[0]), organ)
    with atomic_path(snakemake.output[0]) as path:
        write_ply(path, mesh, NOTE)
