"""Describe every contour by few points: chain codes, corners and closed splines."""

from cccd.curves.describe import describe_curves
from cccd.settings.curves import CurveSettings
from cccd.store import read_curves, write_curves
from cccd_workflow.job import job

with job(snakemake.log[0], "{case}/{organ}".format(**snakemake.wildcards), snakemake.input, snakemake.output):
    contours = read_curves(snakemake.input.contours)
    write_curves(snakemake.output[0], describe_curves(contours, CurveSettings(**snakemake.params.settings)))
