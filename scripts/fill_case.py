"""Fill all organs of a case with tetrahedra, and write them for solvers."""

from pathlib import Path

from cccd.job import job
from cccd.settings.surface import TetrahedraSettings
from cccd.store import atomic_path, write_json
from cccd.surface.export import read_surface
from cccd.tetrahedra.build import fill_and_measure
from cccd.tetrahedra.formats import inp, msh, vtu

with job(snakemake.log[0], snakemake.wildcards.case, snakemake.input, snakemake.output):
    surfaces = [*map(read_surface, snakemake.input.surfaces, snakemake.input.meshes)]
    organs = dict(zip(snakemake.params.organs, (surface.mesh for surface in surfaces), strict=True))
    settings = TetrahedraSettings(**snakemake.params.settings)
    filled, report = fill_and_measure(organs, settings, surfaces[0].frame)
    for writer, name in ((msh, "msh"), (vtu, "vtu"), (inp, "inp")):
        with atomic_path(Path(snakemake.output[name])) as temporary:
            writer.write_tetrahedra(temporary, filled)
    write_json(snakemake.output.report, report)
