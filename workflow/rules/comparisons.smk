"""Comparisons: the methods that the paper names and today's, on the same structures, in the same run."""

#: One rule per comparison of the registry: compare_corners, compare_reconstruction and so on.
for comparison in comparisons().values():

    rule:
        name:
            f"compare_{comparison.name}"
        input:
            **plan.comparison_inputs(comparison),
        output:
            **(
                {
                    "figures": f"results/{{case}}/{{organ}}/comparisons/{comparison.name}.h5"
                }
                if comparison.figures
                else {}
            ),
            rows=f"results/{{case}}/{{organ}}/comparisons/{comparison.name}.csv",
        log:
            f"logs/{{case}}/{{organ}}/compare_{comparison.name}.log",
        benchmark:
            f"benchmarks/{{case}}/{{organ}}/compare_{comparison.name}.tsv"
        priority: comparison.minutes  # the longest first, so that none is left alone at the end
        group:
            "structure"
        conda:
            "../../envs/cccd.yaml"
        threads: 1
        resources:
            mem_mb=memory(*comparison.memory_mb),
            runtime=minutes(comparison.minutes),
        params:
            library=plan.comparison_library(comparison),
            run=comparison.run,
            figures=comparison.figures,
            readers={name: inputs()[name].read for name in comparison.inputs},
            settings=plan.comparison_settings(comparison),
            sections=comparison.settings,
            seed={"seed": config["seed"]} if comparison.seeded else {},
        script:
            "../../scripts/compare_structure.py"


rule measure_structure:
    """Everything measured on one structure, in one JSON, and what the page's viewer shows of it."""
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
        runtime=minutes(20),
    params:
        library=library("measure_structure"),
        lofting=LOFTING,
    script:
        "../../scripts/measure_structure.py"
