"""One spline for all cases of an organ: `snakemake shapes`. Nothing else reads it."""

from cccd_shapes import FROM_MEAN, POINTS, ROUNDS


rule shapes:
    """One spline for all cases of each organ that three cases have: mean, modes, scores, tests of groups."""
    input:
        expand(f"{SHAPES}/summary.json", organ=CASES),
    localrule: True


rule make_template:
    """The template of a round: of the first one the medoid, of the others the mean of the last round's fits."""
    input:
        surfaces=surfaces_of_organ,
        last=lambda wildcards: [
            f"results/shapes/{wildcards.organ}/template_{number}.h5"
            for number in [int(wildcards.round) - 1]
            if number
        ],
        fits=lambda wildcards: fits_of_round(wildcards, int(wildcards.round) - 1),
    output:
        f"{SHAPES}/template_{{round}}.h5",
    log:
        "logs/shapes/{organ}/template_{round}.log",
    benchmark:
        "benchmarks/shapes/{organ}/template_{round}.tsv"
    wildcard_constraints:
        round="[1-9]",
    conda:
        "../../envs/cccd.yaml"
    threads: 1
    resources:
        mem_mb=memory(2000, 40),
        runtime=minutes(30),
    params:
        library=library("make_template"),
        points=POINTS,
    script:
        "../../scripts/make_template.py"


rule fit_shape:
    """The template of a round on one case."""
    input:
        surface="results/{case}/{organ}/surface.h5",
        template=f"{SHAPES}/template_{{round}}.h5",
        last=lambda wildcards: [
            f"results/shapes/{wildcards.organ}/round_{number - 1}/{wildcards.case}.h5"
            for number in [int(wildcards.round)]
            if number >= FROM_MEAN
        ],
    output:
        f"{SHAPES}/round_{{round}}/{{case}}.h5",
    log:
        "logs/shapes/{organ}/round_{round}/{case}.log",
    benchmark:
        "benchmarks/shapes/{organ}/round_{round}/{case}.tsv"
    wildcard_constraints:
        round="[1-9]",
    conda:
        "../../envs/cccd.yaml"
    threads: 1
    resources:
        mem_mb=memory(1500, 40),
        runtime=minutes(15),
    params:
        library=library("fit_shape"),
    script:
        "../../scripts/fit_shape.py"


rule describe_shapes:
    """Mean and modes of an organ, each case's scores, and whether groups differ; a page with the modes."""
    input:
        surfaces=surfaces_of_organ,
        template=f"{SHAPES}/template_{ROUNDS}.h5",
        fits=lambda wildcards: fits_of_round(wildcards, ROUNDS),
    output:
        summary=f"{SHAPES}/summary.json",
        subjects=f"{SHAPES}/subjects.csv",
        scores=f"{SHAPES}/scores.csv",
        modes=f"{SHAPES}/modes.h5",
        table=f"{SHAPES}/modes.csv",
        page=f"{SHAPES}/modes.html",
    log:
        "logs/shapes/{organ}/describe_shapes.log",
    benchmark:
        "benchmarks/shapes/{organ}/describe_shapes.tsv"
    conda:
        "../../envs/cccd.yaml"
    threads: 1
    resources:
        mem_mb=memory(2000, 60),
        runtime=minutes(30),
    params:
        library=library("describe_shapes"),
        groups=groups_of_organ,
        templates=plan.templates,
    script:
        "../../scripts/describe_shapes.py"
