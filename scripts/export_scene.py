"""Write all organs of a case as solids in one file for CAD, and what they are worth."""

from pathlib import Path

from cccd.job import job
from cccd.settings.surface import SolidSettings
from cccd.solids.build import build_solids, write_organs
from cccd.store import atomic_path, write_json
from cccd.surface.export import check_format, read_surface

with job(snakemake.log[0], snakemake.wildcards.case, snakemake.input, snakemake.output):
    check_format(snakemake.output.scene)
    settings = snakemake.params.settings
    solid = SolidSettings(**settings["solid"])
    paths = zip(snakemake.input.surfaces, snakemake.input.meshes, strict=True)
    meshes = [read_surface(*pair).mesh for pair in paths]
    built = [build_solids(mesh, settings["step_tolerance_mm"], solid) for mesh in meshes]
    organs = dict(zip(snakemake.params.organs, built, strict=True))
    with atomic_path(Path(snakemake.output.scene)) as temporary:
        report = write_organs(temporary, organs, snakemake.wildcards.scene_format)
    write_json(snakemake.output.report, report)
