"""Fill all organs of a case with tetrahedra, and write them for solvers."""

from pathlib import Path

from cccd.inputs.load import scan_of
from cccd.settings.surface import TetrahedraSettings
from cccd.store import atomic_path, read_ply, read_structure, read_surface_frame, write_json
from cccd_tetrahedra.build import fill_and_measure
from cccd_tetrahedra.files import WRITERS
from cccd_workflow.job import job
from cccd_workflow.stage_files import by_organ

with job(snakemake.log[0], snakemake.wildcards.case, snakemake.input, snakemake.output):
    organs = by_organ(read_ply, snakemake.input.meshes)
    frames = by_organ(read_surface_frame, snakemake.input.surfaces)
    structures = by_organ(read_structure, snakemake.input.structures)
    scans = {name: scan_of(structure) for name, structure in structures.items()}
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
