"""Comparisons: the methods that the paper names and today's, on the same structures, in the same run."""

#: One rule for all structures of which the same is compared: structures with a mask, with maps, phantoms.
for number, (together, structures) in enumerate(plan.comparison_jobs()):
    named = "compare_structure" + (f"_{number}" if number else "")

    rule:
        name:
            named
        input:
            **plan.comparison_inputs(together),
        output:
            **{
                comparison.name: files_of_comparison(
                    "results/{case}/{organ}", comparison
                )
                for comparison in together
            },
        log:
            f"logs/{{case}}/{{organ}}/{named}.log",
        benchmark:
            f"benchmarks/{{case}}/{{organ}}/{named}.tsv"
        wildcard_constraints:
            case=only(structures),
        # the longest first, so that none is left alone at the end
        priority: max(comparison.minutes for comparison in together)
        group:
            "structure"
        conda:
            "../../envs/cccd.yaml"
        threads: 1
        resources:
            mem_mb=memory(*map(max, zip(*(one.memory_mb for one in together)))),
            runtime=minutes(sum(comparison.minutes for comparison in together)),
        params:
            library=plan.comparison_library(together),
            calls={one.name: plan.comparison_call(one) for one in together},
        script:
            "../../scripts/compare_structure.py"


rule measure_structure:
    """Everything measured on one structure, in one JSON, a picture, and its page."""
    input:
        structure="results/{case}/{organ}/structure.h5",
        boundaries="results/{case}/{organ}/boundaries.h5",
        contours="results/{case}/{organ}/contours.h5",
        curves="results/{case}/{organ}/curves.h5",
        surface="results/{case}/{organ}/surface.h5",
        mesh="results/{case}/{organ}/surface.ply",
        solids=plan.solid_reports,
        volume=plan.case_reports,
    output:
        metrics="results/{case}/{organ}/metrics.json",
        view="results/{case}/{organ}/view.h5",
        picture=report(
            "results/{case}/{organ}/picture.png",
            caption="../report/surface.rst",
            category="Surfaces",
            labels={"case": "{case}", "organ": "{organ}"},
        ),
        page=report(
            "results/{case}/{organ}/report.html",
            caption="../report/structure.rst",
            category="Structures",
            labels={"case": "{case}", "organ": "{organ}"},
        ),
    log:
        "logs/{case}/{organ}/measure_structure.log",
    benchmark:
        "benchmarks/{case}/{organ}/measure_structure.tsv"
    group:
        plan.group_after_filling
    conda:
        "../../envs/cccd.yaml"
    threads: 1
    resources:
        mem_mb=memory(2500, 60),
        runtime=minutes(30),
    params:
        library=library("measure_structure", *registered()),
        templates=plan.templates,
        config=config,
    script:
        "../../scripts/measure_structure.py"
