"""Describe every contour by few points: chain codes, corners and closed splines."""

from cccd.curves.describe import describe_curves
from cccd.settings.curves import CurveSettings
from cccd_workflow.job import job
from cccd_workflow.stage_files import read_curves, write_curves

with job(snakemake.log[0], "{case}/{organ}".format(**snakemake.wildcards), snakemake.input, snakemake.output):
    contours = read_curves(snakemake.input.contours)
    write_curves(snakemake.output[0], describe_curves(contours, CurveSettings(**snakemake.params.settings)))
