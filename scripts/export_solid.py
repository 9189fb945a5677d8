"""Write the surface's bodies as closed solids for CAD, and what they are worth."""

from cccd.job import job
from cccd.settings.surface import SolidSettings
from cccd.store import write_json
from cccd.surface.export import Scan, read_surface, write_surface

with job(snakemake.log[0], "{case}/{organ}".format(**snakemake.wildcards)):
    surface = read_surface(snakemake.input.surface, snakemake.input.mesh)
    scan = Scan(
        snakemake.wildcards.organ,
        tolerance_mm=snakemake.params.tolerance_mm,
        solid=SolidSettings(**snakemake.params.settings),
    )
    report = write_surface(snakemake.output.solid, surface, scan)
    write_json(snakemake.output.report, report)
