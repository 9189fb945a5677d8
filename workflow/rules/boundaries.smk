"""Boundaries: structure.h5 -> boundary pixels of every slice (section 4.3, Algorithm 1)."""


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
    group:
        "structure"
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
