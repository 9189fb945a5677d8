"""Mean, modes, scores and tests of groups, of the last round's fits of an organ."""

from pathlib import Path

from cccd.store import read_bodies
from cccd_shapes.cohort import Cohort, read_fit
from cccd_shapes.model import describe
from cccd_shapes.subjects import read_surfaces
from cccd_shapes.template import Template
from cccd_workflow.job import job

files, organ = snakemake.input, snakemake.wildcards.organ
with job(snakemake.log[0], f"shapes/{organ}", files, snakemake.output) as log:
    subjects = read_surfaces(files.surfaces, snakemake.params.groups)
    template = Template(*read_bodies(files.template))
    cohort = Cohort.judged(subjects, [*map(read_fit, files.fits)], template)
    for warning in describe(cohort, Path(snakemake.output.summary).parent)["warnings"]:
        log.warning(warning)
