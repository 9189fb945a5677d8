"""Surfaces: contours -> closed spline surface -> meshes for viewers and CAD."""

#: What of the section decides on each organ alone.
LOFTING = omit("surface", *FILE_KEYS)

#: Cases whose organs share their walls.
SHARING = [(case,) for case in cohort.shared]


wildcard_constraints:
    exported=plan.other_exports,
    scene_format="|".join(formats("solids")),


rule loft_surface:
    """Loft the contours of all slices: one closed surface per body."""
    input:
        contours="results/{case}/{organ}/contours.h5",
        structure="results/{case}/{organ}/structure.h5",
        calibration=plan.calibration,
    output:
        surface="results/{case}/{organ}/surface.h5",
        mesh="results/{case}/{organ}/surface.ply",
    log:
        "logs/{case}/{organ}/loft_surface.log",
    benchmark:
        "benchmarks/{case}/{organ}/loft_surface.tsv"
    wildcard_constraints:
        case=besides(SHARING),
    priority: ON_THE_WAY
    group:
        "structure"
    conda:
        "../../envs/cccd.yaml"
    threads: 1
    resources:
        mem_mb=memory(2500, 40),
        runtime=minutes(20),
    params:
        way="loft_surface",
        library=library("loft_surface"),
        settings=LOFTING,
    script:
        "../../scripts/{params.way}.py"


rule share_walls:
    """Smooth the organs of a case together that touch: each wall between two of them is one surface."""
    input:
        structures=plan.sharing_organs("structure.h5"),
    output:
        "results/{case}/walls.h5",
    log:
        "logs/{case}/share_walls.log",
    benchmark:
        "benchmarks/{case}/share_walls.tsv"
    wildcard_constraints:
        case=only(SHARING),
    conda:
        "../../envs/cccd.yaml"
    threads: 1
    resources:
        mem_mb=memory(3000, 60),
        runtime=minutes(60),
    params:
        library=library("share_walls"),
        settings=LOFTING,
    script:
        "../../scripts/share_walls.py"


use rule loft_surface as take_surface with:
    input:
        contours="results/{case}/{organ}/contours.h5",
        structure="results/{case}/{organ}/structure.h5",
        calibration=plan.calibration,
        walls="results/{case}/walls.h5",
    output:
        surface="results/{case}/{organ}/surface.h5",
        mesh="results/{case}/{organ}/surface.ply",
    log:
        "logs/{case}/{organ}/take_surface.log",
    benchmark:
        "benchmarks/{case}/{organ}/take_surface.tsv"
    wildcard_constraints:
        case=only(SHARING),
    params:
        way="take_surface",
        library=library("take_surface"),
        settings=LOFTING,


rule export_file:
    """The surface in one more format, by the name of its file."""
    input:
        surface="results/{case}/{organ}/surface.h5",
        mesh="results/{case}/{organ}/surface.ply",
        structure="results/{case}/{organ}/structure.h5",
        scan=cohort.source_files,
        materials=plan.materials,
    output:
        files=["results/{case}/{organ}/{exported}"],
        reports=[],
    log:
        "logs/{case}/{organ}/export_{exported}.log",
    benchmark:
        "benchmarks/{case}/{organ}/export_{exported}.tsv"
    group:
        "structure"
    conda:
        "../../envs/cccd.yaml"
    threads: 1
    resources:
        mem_mb=memory(2500, 60),
        runtime=minutes(30),
    params:
        library=lambda wildcards: plan.export_library([wildcards.exported]),
        settings=pick("surface", *EXPORT_KEYS),
    script:
        "../../scripts/export_surface.py"


if plan.exports:

    use rule export_file as export_surface with:
        output:
            files=[f"results/{{case}}/{{organ}}/{file}" for file in plan.exports],
            reports=plan.solid_reports,
        log:
            "logs/{case}/{organ}/export_surface.log",
        benchmark:
            "benchmarks/{case}/{organ}/export_surface.tsv"
        params:
            library=plan.export_library(plan.exports),
            settings=pick("surface", *EXPORT_KEYS),


rule fill_case:
    """Tetrahedra through all organs of a case: a region each, named boundaries, walls shared; for Gmsh, VTK,
    Abaqus, CalculiX and FEBio.
    """
    input:
        surfaces=plan.whole_case("surface.h5"),
        meshes=plan.whole_case("surface.ply"),
        structures=plan.whole_case("structure.h5"),
        materials=plan.materials,
    output:
        msh="results/{case}/volume.msh",
        vtu="results/{case}/volume.vtu",
        inp="results/{case}/volume.inp",
        feb="results/{case}/volume.feb",
        report="results/{case}/volume.json",
    log:
        "logs/{case}/fill_case.log",
    benchmark:
        "benchmarks/{case}/fill_case.tsv"
    conda:
        "../../envs/cccd.yaml"
    threads: 1
    resources:
        mem_mb=memory(2500, 60),
        runtime=minutes(60),
    params:
        library=library("fill_case"),
        settings=pick("surface", "tetrahedra"),
    script:
        "../../scripts/fill_case.py"


rule fit_walls:
    """One spline through the walls of a case's organs that touch."""
    input:
        surfaces=plan.whole_case("surface.h5"),
        meshes=plan.whole_case("surface.ply"),
    output:
        "results/{case}/wall_splines.h5",
    log:
        "logs/{case}/fit_walls.log",
    benchmark:
        "benchmarks/{case}/fit_walls.tsv"
    conda:
        "../../envs/cccd.yaml"
    threads: 1
    resources:
        mem_mb=memory(2500, 60),
        runtime=minutes(60),
    params:
        library=library("fit_walls"),
        tolerance_mm=config["surface"]["step_tolerance_mm"],
    script:
        "../../scripts/fit_walls.py"


rule export_scene:
    """All organs of a case as solids in one file for CAD, by name and colour, and what they are worth."""
    input:
        surfaces=plan.whole_case("surface.h5"),
        meshes=plan.whole_case("surface.ply"),
        spline="results/{case}/wall_splines.h5",
    output:
        scene="results/{case}/scene.{scene_format}",
        report="results/{case}/scene_{scene_format}.json",
    log:
        "logs/{case}/export_scene_{scene_format}.log",
    benchmark:
        "benchmarks/{case}/export_scene_{scene_format}.tsv"
    conda:
        "../../envs/cccd.yaml"
    threads: 1
    resources:
        mem_mb=memory(2500, 60),
        runtime=minutes(60),
    params:
        library=library("export_scene"),
        labels=plan.case_labels,
        tolerance_mm=config["surface"]["step_tolerance_mm"],
    script:
        "../../scripts/export_scene.py"
