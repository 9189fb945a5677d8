"""The template of one round of fits of an organ: the medoid of its cases, or the mean of the last round."""

from cccd.store import read_bodies, write_control_meshes
from cccd_shapes.cohort import Cohort, first_template, read_fit
from cccd_shapes.subjects import read_surfaces
from cccd_shapes.template import Template
from cccd_workflow.job import job

files, organ = snakemake.input, snakemake.wildcards.organ
with job(snakemake.log[0], f"shapes/{organ}", files, snakemake.output):
    subjects = read_surfaces(files.surfaces)
    if files.last:
        last = Template(*read_bodies(files.last[0]))
        template = Cohort.judged(subjects, [*map(read_fit, files.fits)], last).mean()
    else:
        template = first_template(subjects, snakemake.params.points)
    write_control_meshes(snakemake.output[0], [template.spline], subjects[0].frame, {})
