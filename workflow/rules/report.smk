"""Tables over the whole cohort, and the report."""


rule build_tables:
    """One CSV per table of the paper, with this run's figures and the paper's, and one per further table."""
    input:
        metrics=plan.files("metrics.json"),
        comparisons=plan.all_comparison_rows,
        distances=plan.distance_files(),
    output:
        tables=[
            report(
                f"results/tables/{name}.csv",
                caption="../report/table.rst",
                category="Tables",
                labels={"table": name},
            )
            for name in tables()
        ],
        notes="results/tables/notes.json",
    log:
        "logs/build_tables.log",
    benchmark:
        "benchmarks/build_tables.tsv"
    conda:
        "../../envs/cccd.yaml"
    threads: 1
    resources:
        mem_mb=memory(1500, 20),
        runtime=minutes(15),
    params:
        library=library("build_tables", *plan.table_code),
    script:
        "../../scripts/build_tables.py"


rule build_structure_page:
    """A page of one structure, where the cohort is too large for one page."""
    input:
        files=[f"results/{{case}}/{{organ}}/{name}" for name in SHOWN],
        comparisons=plan.comparison_files,
    output:
        report(
            "results/{case}/{organ}/report.html",
            caption="../report/structure.rst",
            category="Structures",
            labels={"case": "{case}", "organ": "{organ}"},
        ),
    log:
        "logs/{case}/{organ}/build_structure_page.log",
    benchmark:
        "benchmarks/{case}/{organ}/build_structure_page.tsv"
    group:
        plan.group_after_filling
    conda:
        "../../envs/cccd.yaml"
    threads: 1
    resources:
        mem_mb=memory(1500, 20),
        runtime=minutes(15),
    params:
        library=library("build_structure_page", *registrations()),
        templates=plan.templates,
        config=config,
    script:
        "../../scripts/build_structure_page.py"


rule build_report:
    """The report: one self-contained page, or for a large cohort an index of the structures' pages."""
    input:
        tables=[f"results/tables/{name}.csv" for name in tables()],
        notes="results/tables/notes.json",
        junctions=plan.junctions.score_files,
        training=plan.junctions.training_files,
        files=plan.reported_files,
        cases=[f"results/{case}/scene.html" for case in cohort.shared],
    output:
        report(
            "results/report.html",
            caption="../report/report.rst",
            category="Report",
            labels={"page": "the whole cohort"},
        ),
    log:
        "logs/build_report.log",
    benchmark:
        "benchmarks/build_report.tsv"
    conda:
        "../../envs/cccd.yaml"
    threads: 1
    resources:
        # 440 MB of 2 structures, 540 of 12 on one page, 370 and 410 of 100 and 400 in an index
        mem_mb=memory(1000 + len(cohort.reconstructed) // 2),
        runtime=minutes(30),
    params:
        library=library("build_report", *plan.report_code),
        templates=plan.templates,
        # The jobs' times. Not an input: where somebody deletes them, no job should run again to measure its own.
        benchmarks="benchmarks",
        structures=[tuple(name) for name in cohort.reconstructed],
        config=config,
    script:
        "../../scripts/build_report.py"
