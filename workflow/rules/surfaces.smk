"""Surfaces: curves -> lofted B-spline surface -> meshes for viewers and CAD, and a picture."""

WRITERS = [
    f"cccd.surface.formats.{name.replace('.', '_')}.write" for name in SURFACE_FORMATS
]


wildcard_constraints:
    format="|".join(re.escape(name) for name in SURFACE_FORMATS if name != "ply"),


rule loft_surface:
    """Match the curves between slices, loft tubes, join branches, cap ends: one closed solid per body."""
    input:
        curves="results/{case}/{organ}/curves.h5",
    output:
        surface="results/{case}/{organ}/surface.h5",
        mesh="results/{case}/{organ}/surface.ply",
    log:
        "logs/{case}/{organ}/loft_surface.log",
    benchmark:
        "benchmarks/{case}/{organ}/loft_surface.tsv"
    group:
        "structure"
    conda:
        "../../envs/cccd.yaml"
    threads: 1
    resources:
        mem_mb=memory(2500, 40),
        runtime=minutes(20),
    params:
        library=library("loft_surface", "cccd.surface.formats.ply.write"),
        settings=leave("surface", "formats", "contour_spacing_mm"),
    script:
        "../../scripts/loft_surface.py"


rule export_surface:
    """The surface for a viewer (STL, VTP, GLB), as patches for CAD (STEP), or back on the scan: a label map on its
    grid (NIfTI), contours on slices (RTSTRUCT).
    """
    input:
        surface="results/{case}/{organ}/surface.h5",
        mesh="results/{case}/{organ}/surface.ply",
        scan=source_files,
    output:
        "results/{case}/{organ}/surface.{format}",
    log:
        "logs/{case}/{organ}/export_surface_{format}.log",
    benchmark:
        "benchmarks/{case}/{organ}/export_surface_{format}.tsv"
    group:
        "structure"
    conda:
        "../../envs/cccd.yaml"
    threads: 1
    resources:
        mem_mb=memory(1500, 40),
        runtime=minutes(10),
    params:
        library=library("export_surface", *WRITERS),
        contour_spacing_mm=config["surface"]["contour_spacing_mm"],
    script:
        "../../scripts/export_surface.py"


rule render_surface:
    """A picture of the surface from three sides; drawn another way where OpenGL is missing."""
    input:
        mesh="results/{case}/{organ}/surface.ply",
    output:
        report(
            "results/{case}/{organ}/picture.png",
            caption="../report/surface.rst",
            category="Surfaces",
            labels={"case": "{case}", "organ": "{organ}"},
        ),
    log:
        "logs/{case}/{organ}/render_surface.log",
    benchmark:
        "benchmarks/{case}/{organ}/render_surface.tsv"
    group:
        "structure"
    conda:
        "../../envs/cccd.yaml"
    threads: 1
    resources:
        mem_mb=memory(1500, 20),
        runtime=minutes(10),
    params:
        library=library("render_surface"),
    script:
        "../../scripts/render_surface.py"
