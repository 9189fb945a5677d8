"""The thick-slice experiment on one structure."""

from cccd.comparisons.thick_slices import thick_slice_experiment
from cccd.job import job
from cccd.store import read_structure, write_table

with job(snakemake.log[0], "{case}/{organ}".format(**snakemake.wildcards)):
    structure = read_structure(snakemake.input.structure)
    settings = {**snakemake.params.settings, "surface": snakemake.params.surface}
    write_table(snakemake.output[0], thick_slice_experiment(structure, settings))
