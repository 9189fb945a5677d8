"""Tables over the whole cohort, and the report."""


rule build_tables:
    """One CSV per table that the structures and their comparisons give rows for."""
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
            for name in plan.tables()
        ],
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


rule build_report:
    """The report: results and warnings of the whole cohort on one page, which leads to the structures' pages."""
    input:
        tables=[f"results/tables/{name}.csv" for name in plan.tables()],
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
        # 370 and 410 MB of 100 and 400 structures
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
