"""Tables over the whole cohort, and the report."""

#: What the tables and the notes, and what the plots are made by.
SUMMARIES = [part for item in ITEMS for part in (item.tabulate, item.note) if part]
PLOTS = [item.plots for item in ITEMS if item.plots]


rule build_tables:
    """One CSV per table of the paper, ours beside theirs, and the tables that go past it."""
    input:
        metrics=for_structures("metrics.json"),
        comparisons=all_comparison_rows,
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
        library=library("build_tables", *SUMMARIES),
    script:
        "../../scripts/build_tables.py"


#: What a page shows of a structure.
SHOWN = [
    "structure.h5",
    "boundaries.h5",
    "curves.h5",
    "surface.h5",
    "view.h5",
    "picture.png",
    "metrics.json",
]
TEMPLATES = sorted(near(path) for path in (ROOT / "workflow" / "report").glob("*.*"))


rule build_structure_page:
    """A page of one structure, where the cohort is too large for one page."""
    input:
        templates=TEMPLATES,
        files=[f"results/{{case}}/{{organ}}/{name}" for name in SHOWN],
        comparisons=comparison_files,
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
        after_filling
    conda:
        "../../envs/cccd.yaml"
    threads: 1
    resources:
        mem_mb=memory(1500, 20),
        runtime=minutes(15),
    params:
        library=library("build_structure_page"),
        config=config,
    script:
        "../../scripts/build_structure_page.py"


rule build_report:
    """The report: one self-contained page, or for a large cohort an index of the structures' pages."""
    input:
        templates=TEMPLATES,
        tables=[f"results/tables/{name}.csv" for name in tables()],
        notes="results/tables/notes.json",
        junctions=JUNCTION_FILES,
        training=TRAINING_FILES,
        files=[file for name in SHOWN for file in for_structures(name)],
        comparisons=all_comparison_files,
        cases=[f"results/{case}/scene.html" for case in SHARED],
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
        mem_mb=memory(2500, 10),
        runtime=minutes(30),
    params:
        library=library("build_report", *SUMMARIES, *PLOTS),
        # The jobs' times. Not an input: where somebody deletes them, no job should run again to measure its own.
        benchmarks="benchmarks",
        structures=RECONSTRUCTED,
        config=config,
    script:
        "../../scripts/build_report.py"
