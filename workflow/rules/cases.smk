"""All organs of a case together: a scene for viewers, a segmentation for Slicer, a list, a page."""


rule build_scene:
    """All organs of a case in one scene with names and colours, one segmentation on the scan's grid, one list."""
    input:
        meshes=plan.whole_case("surface.ply"),
        structure=lambda wildcards: plan.whole_case("structure.h5")(wildcards)[0],
    output:
        scene="results/{case}/scene.glb",
        segmentation="results/{case}/segmentation.seg.nrrd",
        list="results/{case}/scene.json",
    log:
        "logs/{case}/build_scene.log",
    benchmark:
        "benchmarks/{case}/build_scene.tsv"
    conda:
        "../../envs/cccd.yaml"
    threads: 1
    resources:
        mem_mb=memory(2000, 20),
        runtime=minutes(15),
    params:
        library=library("build_scene"),
        labels=plan.case_labels,
    script:
        "../../scripts/build_scene.py"


rule measure_distances:
    """Least distances between neighbouring organs of a case, with the intervals of their error bands."""
    input:
        surfaces=plan.whole_case("surface.h5"),
        meshes=plan.whole_case("surface.ply"),
    output:
        "results/{case}/distances.csv",
    log:
        "logs/{case}/measure_distances.log",
    benchmark:
        "benchmarks/{case}/measure_distances.tsv"
    conda:
        "../../envs/cccd.yaml"
    threads: 1
    resources:
        mem_mb=memory(1500, 40),
        runtime=minutes(15),
    params:
        library=library("measure_distances"),
    script:
        "../../scripts/measure_distances.py"


rule build_case_page:
    """A page of a whole case: organs to switch on and off and to make transparent."""
    input:
        template=near(ROOT / "workflow" / "report" / "case.html.j2"),
        scene="results/{case}/scene.json",
        meshes=plan.whole_case("surface.ply"),
    output:
        report(
            "results/{case}/scene.html",
            caption="../report/case.rst",
            category="Cases",
            labels={"case": "{case}"},
        ),
    log:
        "logs/{case}/build_case_page.log",
    benchmark:
        "benchmarks/{case}/build_case_page.tsv"
    conda:
        "../../envs/cccd.yaml"
    threads: 1
    resources:
        mem_mb=memory(2000, 20),
        runtime=minutes(15),
    params:
        library=library("build_case_page"),
    script:
        "../../scripts/build_case_page.py"
