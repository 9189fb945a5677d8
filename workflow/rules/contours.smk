"""Contours: structure.h5 -> ordered closed curves of every slice, by the script that the data decide."""


rule extract_boundaries:
    """Gaussian blur, 5x5 dilation XOR, edges: the boundary pixels per slice, junctions included."""
    input:
        structure="results/{case}/{organ}/structure.h5",
    output:
        "results/{case}/{organ}/boundaries.h5",
    log:
        "logs/{case}/{organ}/extract_boundaries.log",
    benchmark:
        "benchmarks/{case}/{organ}/extract_boundaries.tsv"
    priority: ON_THE_WAY
    group:
        plan.group_before_walls
    conda:
        "../../envs/cccd.yaml"
    threads: 1
    resources:
        mem_mb=memory(1000, 40),
        runtime=minutes(10),
    params:
        library=library("extract_boundaries"),
        settings=config["boundaries"],
    script:
        "../../scripts/extract_boundaries.py"


rule make_contours:
    """Trace a mask, take drawn contours, or let the network order boundary pixels: ordered closed curves."""
    input:
        unpack(plan.contour_sources),
    output:
        "results/{case}/{organ}/contours.h5",
    log:
        "logs/{case}/{organ}/make_contours.log",
    benchmark:
        "benchmarks/{case}/{organ}/make_contours.tsv"
    priority: ON_THE_WAY
    group:
        plan.group_before_walls
    conda:
        "../../envs/cccd.yaml"
    threads: 1
    resources:
        mem_mb=memory(2500, 20),
        runtime=minutes(15),
    params:
        way=cohort.contour_script,
        library=plan.contour_library,
        settings=plan.contour_settings,
    script:
        "../../scripts/{params.way}.py"
