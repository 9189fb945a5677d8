"""Write one phantom as files: its true surface, its scans, and a table for each of them."""

from cccd.store import write_table
from cccd_paper.phantom_files import describe_scan, scan_phantom, write_scan, write_truth
from cccd_workflow.job import job

organ = snakemake.wildcards.organ
output = snakemake.output
with job(snakemake.log[0], f"phantoms/{organ}", snakemake.input, snakemake.output):
    pixel = tuple(snakemake.params.spacing_mm[:2])
    for n, distance in enumerate(snakemake.params.distances):
        structure = scan_phantom(organ, distance, pixel, snakemake.params.seed)
        write_scan(output.images[n], output.masks[n], structure)
        write_table(output.tables[n], describe_scan(structure))
        if n == 0:
            write_truth(output.truth, structure)
