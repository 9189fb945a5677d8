"""Write all organs of a case as solids in one file for CAD, and what they are worth."""

from pathlib import Path

from cccd.files import check_format
from cccd.store import atomic_path, write_json
from cccd.surface.surface import read_surface
from cccd_labels.scene import name_organs
from cccd_solids.build import write_organs
from cccd_walls.files import read_spline
from cccd_walls.solids import build_together
from cccd_workflow.job import job
from cccd_workflow.stage_files import by_organ

with job(snakemake.log[0], snakemake.wildcards.case, snakemake.input, snakemake.output):
    check_format(snakemake.output.scene)
    surfaces = by_organ(read_surface, snakemake.input.surfaces, snakemake.input.meshes)
    meshes = {name: surface.mesh for name, surface in surfaces.items()}
    colours = {organ.organ: organ.rgb for organ in name_organs(meshes, snakemake.params.labels)}
    organs = build_together(surfaces, read_spline(snakemake.input.spline), snakemake.params.tolerance_mm)
    with atomic_path(Path(snakemake.output.scene)) as temporary:
        report = write_organs(temporary, organs, colours, snakemake.wildcards.scene_format)
    write_json(snakemake.output.report, report)
