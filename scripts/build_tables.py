"""Every table over the whole cohort, the paper's numbers beside ours."""

from pathlib import Path

from cccd.comparisons.gather import compactness, gather, structures
from cccd.comparisons.tables import build_tables, write_remarks
from cccd.job import job
from cccd.store import write_json, write_table

with job(snakemake.log[0], "tables"):
    files = snakemake.input.comparisons
    rows = {
        name: gather(file for file in files if Path(file).stem == name)
        for name in dict.fromkeys(Path(file).stem for file in files)
    }
    tables = build_tables(rows["corners"], rows["reconstruction"])
    remarks = write_remarks(tables, rows["corners"], rows["reconstruction"], rows["active_contour"])
    tables |= {
        "surfaces": rows["isosurfaces"],
        "thick_slices": rows["thick_slices"],
        "k_sweep": rows["k_sweep"],
        "structures": structures(snakemake.input.metrics),
        "compactness": compactness(snakemake.input.metrics),
    }
    for output in snakemake.output[:-1]:
        write_table(output, tables[Path(output).stem])
    write_json(snakemake.output.remarks, remarks)
