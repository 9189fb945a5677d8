"""Import: a row of the cohort sheet -> structure.h5."""


def source_files(wildcards):
    """The row's own files, so that a changed scan comes in again. What is missing the job itself reports."""
    row = ROW[wildcards.case, wildcards.organ]
    paths = (SHEET.parent / row[column] for column in ("image", "mask", "boundary") if row[column])
    return sorted(near(path) for path in paths if path.exists())


def sheet_row(wildcards):
    """The row as plain values; its place in the sheet is left out so that moving a row reruns nothing."""
    row = ROW[wildcards.case, wildcards.organ]
    return {key: value for key, value in sorted(row.items()) if key != "place"}


rule import_structure:
    """Read one structure from whatever the sheet names, crop it to the organ, keep where it came from."""
    input:
        library=library("import_structure"),
        files=source_files,
    output:
        "results/{case}/{organ}/structure.h5",
    log:
        "logs/{case}/{organ}/import_structure.log",
    benchmark:
        "benchmarks/{case}/{organ}/import_structure.tsv"
    params:
        row=sheet_row,
        sheet_name=SHEET.name,
        sheet_folder=near(SHEET.parent),
        settings=config["import"],
        seed=config["seed"],
    threads: 1
    resources:
        mem_mb=memory(1500, 20),
        runtime=minutes(15),
    conda:
        "../../envs/cccd.yaml"
    script:
        "../../scripts/import_structure.py"
