"""The least distances between organs of a case that lie near each other, with their intervals."""

from cccd.store import write_table
from cccd.surface.surface import read_surface
from cccd_labels.between import distance_table, near_pairs
from cccd_workflow.job import job
from cccd_workflow.stage_files import by_organ

case = snakemake.wildcards.case
with job(snakemake.log[0], case, snakemake.input, snakemake.output):
    surfaces = by_organ(read_surface, snakemake.input.surfaces, snakemake.input.meshes)
    write_table(snakemake.output[0], distance_table(case, near_pairs(surfaces)))
