"""Order boundary pixels into closed curves; chain codes, corners and splines of each."""

from cccd.curves import describe_curves
from cccd.curves.ordering import order_structure
from cccd.job import job
from cccd.junctions.checkpoint import load_model
from cccd.settings import CurveSettings
from cccd.store import read_boundaries, read_structure, write_curves

with job(snakemake.log[0], "{case}/{organ}".format(**snakemake.wildcards)):
    structure = read_structure(snakemake.input.structure)
    boundaries = read_boundaries(snakemake.input.boundaries)
    model = load_model(snakemake.input.model)
    settings = CurveSettings(**snakemake.params.settings)
    curves, ordering = order_structure(structure, boundaries, model, settings.ordering)
    codes, corners, splines, description = describe_curves(curves, settings)
    write_curves(
        snakemake.output[0], curves, codes, corners, splines, {"ordering": ordering, "curves": description}
    )
