"""Comparisons: every method the paper names, on the same structures, in the same run."""


rule compare_corners:
    """Harris, Shi-Tomasi, FAST and SUSAN corners, each fused with a B-spline (Tables 1 and 2)."""
    input:
        structure="results/{case}/{organ}/structure.h5",
        curves="results/{case}/{organ}/curves.h5",
    output:
        "results/{case}/{organ}/comparisons/corners.csv",
    log:
        "logs/{case}/{organ}/compare_corners.log",
    benchmark:
        "benchmarks/{case}/{organ}/compare_corners.tsv"
    group:
        "structure"
    conda:
        "../../envs/cccd.yaml"
    threads: 1
    resources:
        mem_mb=memory(1500, 20),
        runtime=minutes(20),
    params:
        library=library("compare_corners"),
        settings=pick("comparisons", "corners"),
        seed=config["seed"],
    script:
        "../../scripts/compare_corners.py"


rule compare_reconstruction:
    """Curve reconstruction from points: Crust and its kin, Connect2D, Crawl, a tour (Tables 4 and 5)."""
    input:
        structure="results/{case}/{organ}/structure.h5",
        curves="results/{case}/{organ}/curves.h5",
        model="results/gnn/model.pt",
    output:
        "results/{case}/{organ}/comparisons/reconstruction.csv",
    log:
        "logs/{case}/{organ}/compare_reconstruction.log",
    benchmark:
        "benchmarks/{case}/{organ}/compare_reconstruction.tsv"
    group:
        "structure"
    conda:
        "../../envs/cccd.yaml"
    threads: 1
    resources:
        mem_mb=memory(2500, 20),
        runtime=minutes(20),
    params:
        library=library("compare_reconstruction"),
        settings=pick("comparisons", "reconstruction"),
        seed=config["seed"],
    script:
        "../../scripts/compare_reconstruction.py"


rule compare_active_contour:
    """A B-spline snake from a circular seed (Figure 15)."""
    input:
        structure="results/{case}/{organ}/structure.h5",
        curves="results/{case}/{organ}/curves.h5",
    output:
        "results/{case}/{organ}/comparisons/active_contour.csv",
    log:
        "logs/{case}/{organ}/compare_active_contour.log",
    benchmark:
        "benchmarks/{case}/{organ}/compare_active_contour.tsv"
    group:
        "structure"
    conda:
        "../../envs/cccd.yaml"
    threads: 1
    resources:
        mem_mb=memory(1500, 20),
        runtime=minutes(20),
    params:
        library=library("compare_active_contour"),
        settings=pick("comparisons", "active_contour"),
        seed=config["seed"],
    script:
        "../../scripts/compare_active_contour.py"


rule compare_isosurfaces:
    """Marching cubes, flying edges and the other surfaces people take today, measured alike."""
    input:
        structure="results/{case}/{organ}/structure.h5",
        curves="results/{case}/{organ}/curves.h5",
        surface="results/{case}/{organ}/surface.h5",
        mesh="results/{case}/{organ}/surface.ply",
    output:
        "results/{case}/{organ}/comparisons/isosurfaces.csv",
    log:
        "logs/{case}/{organ}/compare_isosurfaces.log",
    benchmark:
        "benchmarks/{case}/{organ}/compare_isosurfaces.tsv"
    group:
        "structure"
    conda:
        "../../envs/cccd.yaml"
    threads: 1
    resources:
        mem_mb=memory(3000, 60),
        runtime=minutes(30),
    params:
        library=library("compare_isosurfaces"),
        settings=pick("comparisons", "isosurfaces"),
        seed=config["seed"],
    script:
        "../../scripts/compare_isosurfaces.py"


rule compare_thick_slices:
    """Keep every n-th slice, reconstruct, compare with the full resolution."""
    input:
        structure="results/{case}/{organ}/structure.h5",
    output:
        "results/{case}/{organ}/comparisons/thick_slices.csv",
    log:
        "logs/{case}/{organ}/compare_thick_slices.log",
    benchmark:
        "benchmarks/{case}/{organ}/compare_thick_slices.tsv"
    group:
        "structure"
    conda:
        "../../envs/cccd.yaml"
    threads: 1
    resources:
        mem_mb=memory(3000, 60),
        runtime=minutes(30),
    params:
        library=library("compare_thick_slices"),
        surface=leave("surface", "formats", "contour_spacing_mm"),
        settings=pick("comparisons", "thick_slices"),
        seed=config["seed"],
    script:
        "../../scripts/compare_thick_slices.py"


rule measure_structure:
    """Everything measured on one structure, in one JSON."""
    input:
        structure="results/{case}/{organ}/structure.h5",
        curves="results/{case}/{organ}/curves.h5",
        surface="results/{case}/{organ}/surface.h5",
        mesh="results/{case}/{organ}/surface.ply",
    output:
        "results/{case}/{organ}/metrics.json",
    log:
        "logs/{case}/{organ}/measure_structure.log",
    benchmark:
        "benchmarks/{case}/{organ}/measure_structure.tsv"
    group:
        "structure"
    conda:
        "../../envs/cccd.yaml"
    threads: 1
    resources:
        mem_mb=memory(2500, 60),
        runtime=minutes(20),
    params:
        library=library("measure_structure"),
    script:
        "../../scripts/measure_structure.py"
