"""Write the surface, or a side of its error band, in another format: for viewers, or lying on the scan."""

from pathlib import Path

from cccd.files.options import ExportOptions
from cccd.files.write import write_surface
from cccd.job import job
from cccd.store import read_drawn
from cccd.surface.surface import read_surface

with job(snakemake.log[0], "{case}/{organ}".format(**snakemake.wildcards), snakemake.input, snakemake.output):
    surface = read_surface(snakemake.input.surface, snakemake.input.mesh)
    side = dict(snakemake.wildcards).get("side")
    if side is not None:
        surface = surface.sides()[side]
    series = next((path for path in map(Path, snakemake.input.scan) if path.is_dir()), None)
    settings = snakemake.params.settings
    options = ExportOptions(
        snakemake.wildcards.organ,
        settings["contour_spacing_mm"],
        series,
        keep_patient=settings["keep_patient"],
        drawn=read_drawn(snakemake.input.structure),
    )
    write_surface(snakemake.output[0], surface, options)
