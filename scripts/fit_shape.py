"""The template of one round on one case."""

from cccd.store import read_bodies
from cccd_shapes.cohort import fit_subject, read_fit, write_fit
from cccd_shapes.subjects import read_surfaces
from cccd_shapes.template import Template
from cccd_workflow.job import job

files = snakemake.input
with job(snakemake.log[0], "shapes/{organ}/{case}".format(**snakemake.wildcards), files, snakemake.output):
    (subject,) = read_surfaces([files.surface])
    before = read_fit(files.last[0]) if files.last else None
    fit = fit_subject(Template(*read_bodies(files.template)), subject, before)
    write_fit(snakemake.output[0], fit, subject)
