"""The surface in the clinic's formats, lying on the scan: a label map or RTSTRUCT contours."""

from pathlib import Path

from cccd.job import job
from cccd.surface.export import read_surface
from cccd.volumes.clinical_export import write_label_map, write_rtstruct

with job(snakemake.log[0], "{case}/{organ}".format(**snakemake.wildcards)):
    surface = read_surface(snakemake.input.surface, snakemake.input.mesh)
    mesh = surface.vertices, surface.faces, surface.frame
    if snakemake.wildcards.clinical == "nii.gz":
        write_label_map(snakemake.output[0], *mesh)
    else:
        series = [path for path in map(Path, snakemake.input.scan) if path.is_dir()]
        write_rtstruct(
            snakemake.output[0],
            *mesh,
            name=snakemake.wildcards.organ,
            spacing_mm=snakemake.params.spacing_mm,
            reference=series[0] if series else None,
        )
