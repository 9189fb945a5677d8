"""Write the surface, and the sides of its error band, in other formats; and what its solids are worth."""

from pathlib import Path

from cccd.files import ExportOptions, write_surface
from cccd.inputs.load import scan_of
from cccd.settings.surface import LoftSettings
from cccd.store import read_drawn, read_structure, write_json
from cccd.surface.surface import read_surface
from cccd_workflow.job import job

with job(snakemake.log[0], "{case}/{organ}".format(**snakemake.wildcards), snakemake.input, snakemake.output):
    surface = read_surface(snakemake.input.surface, snakemake.input.mesh)
    options = ExportOptions(
        snakemake.wildcards.organ,
        next((path for path in map(Path, snakemake.input.scan) if path.is_dir()), None),
        drawn=read_drawn(snakemake.input.structure),
        settings=LoftSettings(**snakemake.params.settings),
        scan=scan_of(read_structure(snakemake.input.structure)),
    )
    reports = {Path(file).stem.removeprefix("solid_"): file for file in snakemake.output.reports}
    for path in map(Path, snakemake.output.files):
        stem, _, form = path.name.partition(".")
        side = stem.partition("_")[2]
        report = write_surface(path, surface.sides()[side] if side else surface, options)
        if form in reports:
            write_json(reports[form], report)
