"""Write the surface's bodies as solids for CAD or as tetrahedra, and what they are worth."""

from cccd.files.options import ExportOptions
from cccd.files.write import write_surface
from cccd.inputs.load import scan_of
from cccd.job import job
from cccd.settings.surface import TetrahedraSettings
from cccd.store import read_structure, write_json
from cccd.surface.surface import read_surface

with job(snakemake.log[0], "{case}/{organ}".format(**snakemake.wildcards), snakemake.input, snakemake.output):
    settings = snakemake.params.settings
    surface = read_surface(snakemake.input.surface, snakemake.input.mesh)
    options = ExportOptions(
        snakemake.wildcards.organ,
        tolerance_mm=settings["step_tolerance_mm"],
        tetrahedra=TetrahedraSettings(**settings["tetrahedra"]),
        scan=scan_of(read_structure(snakemake.input.structure)),
    )
    report = write_surface(snakemake.output.solid, surface, options)
    write_json(snakemake.output.report, report)
