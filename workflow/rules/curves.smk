"""Curves: ordered contours -> chain codes, corners, closed splines."""


rule fit_curves:
    """Chain codes and corners of every contour, and a closed spline with as few control points as will do."""
    input:
        contours="results/{case}/{organ}/contours.h5",
    output:
        "results/{case}/{organ}/curves.h5",
    log:
        "logs/{case}/{organ}/fit_curves.log",
    benchmark:
        "benchmarks/{case}/{organ}/fit_curves.tsv"
    priority: ON_THE_WAY
    group:
        "structure"
    conda:
        "../../envs/cccd.yaml"
    threads: 1
    resources:
        mem_mb=memory(1500, 20),
        runtime=minutes(15),
    params:
        library=library("fit_curves"),
        settings=omit("curves", "ordering", "sweep"),
    script:
        "../../scripts/fit_curves.py"
