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
    """Read one structure from whatever the sheet names, crop it to the organ, keep where it came from; list its boundary pixels; trace
    its mask, take its drawn contours, or let the network order the pixels.
    """
    input:
        files=cohort.source_files,
        segmentation=plan.segmentation_files,
        model=plan.model_files,
    output:
        structure="results/{case}/{organ}/structure.h5",
        boundaries="results/{case}/{organ}/boundaries.h5",
        contours="results/{case}/{organ}/contours.h5",
    log:
        "logs/{case}/{organ}/import_structure.log",
    benchmark:
        "benchmarks/{case}/{organ}/import_structure.tsv"
    wildcard_constraints:
        case=besides(plan.found_regions),
    priority: ON_THE_WAY
    group:
        "import"
    conda:
        "../../envs/cccd.yaml"
    threads: 1
    resources:
        mem_mb=memory(2500, 40),
        runtime=minutes(30),
    params:
        library=plan.import_library,
        row=plan.sheet_row,
        sheet_name=cohort.sheet.name,
        sheet_folder=plan.sheet_folder,
        settings=config["import"],
        boundaries=config["boundaries"],
        way=plan.contour_function,
        decoding=plan.decoding,
        seed=config["seed"],
    script:
        "../../scripts/import_structure.py"


use rule import_structure as import_image with:
    output:
        structure="results/{case}/{organ}/structure.h5",
        boundaries="results/{case}/{organ}/boundaries.h5",
        contours="results/{case}/{organ}/contours.h5",
        # what was taken as the organ's region, to be looked at
        region="results/{case}/{organ}/region.png",
    log:
        "logs/{case}/{organ}/import_image.log",
    benchmark:
        "benchmarks/{case}/{organ}/import_image.tsv"
    wildcard_constraints:
        case=only(plan.found_regions),
