"""Import: a row of the cohort sheet -> structure.h5."""


rule fetch_file:
    """Bring a file that the sheet names by an address: whole, with the checksum that the sheet gives, once."""
    output:
        "downloads/{key}/{file}",
    log:
        "logs/downloads/{key}/{file}.log",
    benchmark:
        "benchmarks/downloads/{key}/{file}.tsv"
    wildcard_constraints:
        key="[0-9a-f]{16}",
        file="[A-Za-z0-9._-]+",
    retries: 2
    # where the run was started: nodes of a cluster need no network
    localrule: True
    conda:
        "../../envs/cccd.yaml"
    threads: 1
    resources:
        mem_mb=memory(500),
        runtime=minutes(60),
    params:
        # no digest of the library: its edits change no byte of a download
        address=lambda wildcards: cohort.remote_file(wildcards).address,
        sha256=lambda wildcards: cohort.remote_file(wildcards).sha256,
    script:
        "../../scripts/fetch_file.py"


rule import_structure:
    """Read one structure from whatever the sheet names, crop it to the organ, keep where it came from."""
    input:
        files=cohort.source_files,
        segmentation=plan.segmentation_files,
    output:
        "results/{case}/{organ}/structure.h5",
    log:
        "logs/{case}/{organ}/import_structure.log",
    benchmark:
        "benchmarks/{case}/{organ}/import_structure.tsv"
    priority: ON_THE_WAY
    group:
        "import"
    conda:
        "../../envs/cccd.yaml"
    threads: 1
    resources:
        mem_mb=memory(1500, 20),
        runtime=minutes(15),
    params:
        library=library("import_structure", *plan.readers),
        row=plan.sheet_row,
        sheet_name=cohort.sheet.name,
        sheet_folder=plan.sheet_folder,
        settings=config["import"],
        seed=config["seed"],
    script:
        "../../scripts/import_structure.py"


rule draw_region:
    """A picture of the region that was taken from an image without a mask, to be looked at."""
    input:
        structure="results/{case}/{organ}/structure.h5",
    output:
        "results/{case}/{organ}/region.png",
    log:
        "logs/{case}/{organ}/draw_region.log",
    benchmark:
        "benchmarks/{case}/{organ}/draw_region.tsv"
    group:
        "structure"
    conda:
        "../../envs/cccd.yaml"
    threads: 1
    resources:
        mem_mb=memory(1000, 20),
        runtime=minutes(10),
    params:
        library=library("draw_region"),
    script:
        "../../scripts/draw_region.py"
