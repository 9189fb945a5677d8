"""Fill all organs of a case with tetrahedra, and write them for solvers."""

from pathlib import Path

from cccd.inputs.load import scan_of
from cccd.settings.surface import TetrahedraSettings
from cccd.store import atomic_path, read_ply, read_structure, read_surface_frame, write_json
from cccd_tetrahedra.build import fill_and_measure
from cccd_tetrahedra.files import WRITERS
from cccd_workflow.job import job

with job(snakemake.log[0], snakemake.wildcards.case, snakemake.input, snakemake.output):
    organs = {Path(path).parent.name: read_ply(path) for path in snakemake.input.meshes}
    frames = {Path(path).parent.name: read_surface_frame(path) for path in snakemake.input.surfaces}
    scans = {Path(path).parent.name: scan_of(read_structure(path)) for path in snakemake.input.structures}
    filled, report = fill_and_measure(
        organs,
        TetrahedraSettings(**snakemake.params.settings["tetrahedra"]),
        frames,
        {name: scan for name, scan in scans.items() if scan is not None},
    )
    for form, write in WRITERS.items():
        with atomic_path(Path(snakemake.output[form])) as temporary:
            write(temporary, filled)
    write_json(snakemake.output.report, report)
