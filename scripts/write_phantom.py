"""Write one phantom as files: its true surface, its scans, and a table for each of them."""

from cccd.store import write_table
from cccd_datasets.phantoms import make_phantom
from cccd_paper.phantom_files import describe_scan, write_scan, write_truth
from cccd_workflow.job import job

organ = snakemake.wildcards.organ
output = snakemake.output
with job(snakemake.log[0], f"phantoms/{organ}", snakemake.input, snakemake.output):
    pixel = tuple(snakemake.params.spacing_mm[:2])
    for n, distance in enumerate(snakemake.params.distances):
        # the same individual at every distance: that of case "phantom" in a cohort of the same seed
        spacing, seed = (*pixel, distance), snakemake.params.seed
        structure = make_phantom("phantom", organ, spacing, seed=seed, margin_voxels=3, location=organ)
        write_scan(output.images[n], output.masks[n], structure)
        write_table(output.tables[n], describe_scan(structure))
        if n == 0:
            write_truth(output.truth, structure)
