"""Which organs of a case touch others and will share their walls."""

from cccd.job import job
from cccd.solids.shared_walls import read_structures, with_neighbours
from cccd.store import write_json

with job(snakemake.log[0], snakemake.wildcards.case, snakemake.input, snakemake.output):
    structures = read_structures(snakemake.input)
    sharing = sorted(structures[label].organ for label in with_neighbours(structures))
    write_json(snakemake.output[0], {"sharing": sharing})
