"""Curves: boundary pixels -> ordered curves, chain codes, corners, closed splines."""


rule trace_curves:
    """Order the boundary pixels, find their corners, fit a closed spline to every curve."""
    input:
        structure="results/{case}/{organ}/structure.h5",
        boundaries="results/{case}/{organ}/boundaries.h5",
        model="results/gnn/model.pt",
    output:
        "results/{case}/{organ}/curves.h5",
    log:
        "logs/{case}/{organ}/trace_curves.log",
    benchmark:
        "benchmarks/{case}/{organ}/trace_curves.tsv"
    group:
        "structure"
    conda:
        "../../envs/cccd.yaml"
    threads: 1
    resources:
        mem_mb=memory(2500, 20),
        runtime=minutes(15),
    params:
        library=library("trace_curves"),
        settings=leave("curves", "sweep"),
    script:
        "../../scripts/trace_curves.py"
