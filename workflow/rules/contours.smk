"""Contours: structure.h5 -> ordered closed curves of every slice, by the way that the data decide (`way_of`)."""


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


def contour_sources(wildcards):
    """What the structure's way reads: its boundary pixels and the network only where they must be ordered."""
    names = ["structure"] + ["boundaries"] * (way_of(wildcards) == "order_contours")
    files = {
        name: f"results/{wildcards.case}/{wildcards.organ}/{name}.h5" for name in names
    }
    return files | ({"model": MODEL} if "boundaries" in files else {})


def ordering_settings(wildcards):
    """Settings of the network's decoder, for the structures whose boundary pixels it orders."""
    return config["gnn"]["inference"] if way_of(wildcards) == "order_contours" else {}


rule make_contours:
    """Trace a mask, take drawn contours, or let the network order boundary pixels: ordered closed curves."""
    input:
        unpack(contour_sources),
    output:
        "results/{case}/{organ}/contours.h5",
    log:
        "logs/{case}/{organ}/make_contours.log",
    benchmark:
        "benchmarks/{case}/{organ}/make_contours.tsv"
    group:
        "structure"
    conda:
        "../../envs/cccd.yaml"
    threads: 1
    resources:
        mem_mb=memory(2500, 20),
        runtime=minutes(15),
    params:
        way=way_of,
        library=lambda wildcards: library(way_of(wildcards)),
        settings=ordering_settings,
    script:
        "../../scripts/{params.way}.py"
