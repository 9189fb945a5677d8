"""The least distances between organs of a case that lie near each other, with their intervals."""

from pathlib import Path

from cccd.store import write_table
from cccd.surface.surface import read_surface
from cccd_labels.between import distance_table, near_pairs
from cccd_workflow.job import job

case = snakemake.wildcards.case
with job(snakemake.log[0], case, snakemake.input, snakemake.output):
    files = zip(snakemake.input.surfaces, snakemake.input.meshes, strict=True)
    surfaces = {Path(mesh).parent.name: read_surface(surface, mesh) for surface, mesh in files}
    write_table(snakemake.output[0], distance_table(case, near_pairs(surfaces)))
