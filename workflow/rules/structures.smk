"""Import: a row of the cohort sheet -> structure.h5."""


rule import_structure:
    """Read one structure from whatever the sheet names, crop it to the organ, keep where it came from."""
    input:
        files=source_files,
    output:
        "results/{case}/{organ}/structure.h5",
    log:
        "logs/{case}/{organ}/import_structure.log",
    benchmark:
        "benchmarks/{case}/{organ}/import_structure.tsv"
    group:
        "import"
    conda:
        "../../envs/cccd.yaml"
    threads: 1
    resources:
        mem_mb=memory(1500, 20),
        runtime=minutes(15),
    params:
        library=library("import_structure"),
        row=sheet_row,
        sheet_name=SHEET.name,
        sheet_folder=near(SHEET.parent),
        settings=config["import"],
        seed=config["seed"],
    script:
        "../../scripts/import_structure.py"
