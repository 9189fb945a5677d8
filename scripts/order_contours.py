"""Order boundary pixels into closed curves by the junction network."""

from cccd.job import job
from cccd.settings.junctions import InferenceSettings
from cccd.store import read_boundaries, read_structure, write_contours
from cccd_junctions.checkpoint import load_model
from cccd_junctions.ordering import order_contours

with job(snakemake.log[0], "{case}/{organ}".format(**snakemake.wildcards), snakemake.input, snakemake.output):
    structure = read_structure(snakemake.input.structure)
    boundaries = read_boundaries(snakemake.input.boundaries)
    model = load_model(snakemake.input.model)
    settings = InferenceSettings(**snakemake.params.settings)
    write_contours(snakemake.output[0], *order_contours(structure, boundaries, model, settings))
