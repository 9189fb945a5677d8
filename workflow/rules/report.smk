"""Tables over the whole cohort, and the report."""

#: What each structure's comparisons leave, by the name of its rule's file.
COMPARISONS = [
    "corners",
    "reconstruction",
    "active_contour",
    "isosurfaces",
    "thick_slices",
    "k_sweep",
]
TABLES = [
    "table1_corners",
    "table2_fuse",
    "table3_segmentation",
    "table4_reconstruction",
    "table5_times",
    "surfaces",
    "thick_slices",
    "k_sweep",
    "structures",
    "compactness",
]


rule build_tables:
    """One CSV per table of the paper, ours beside theirs, and the tables that go past it."""
    input:
        metrics=for_structures("metrics.json"),
        comparisons=[
            file
            for name in COMPARISONS
            for file in for_structures(f"comparisons/{name}.csv")
        ],
    output:
        [
            report(
                f"results/tables/{name}.csv",
                caption="../report/table.rst",
                category="Tables",
                labels={"table": name},
            )
            for name in TABLES
        ],
        remarks="results/tables/remarks.json",
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
        library=library("build_tables"),
    script:
        "../../scripts/build_tables.py"


#: What a page shows of a structure.
SHOWN = [
    "structure.h5",
    "boundaries.h5",
    "curves.h5",
    "surface.h5",
    "surface.ply",
    "picture.png",
    "metrics.json",
    *(f"comparisons/{name}.csv" for name in COMPARISONS),
]
TEMPLATES = sorted(near(path) for path in (ROOT / "workflow" / "report").glob("*.*"))


rule build_structure_page:
    """A page of one structure, where the cohort is too large for one page."""
    input:
        templates=TEMPLATES,
        files=[f"results/{{case}}/{{organ}}/{name}" for name in SHOWN],
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
        "structure"
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
        tables=[f"results/tables/{name}.csv" for name in TABLES],
        remarks="results/tables/remarks.json",
        junctions=["results/tables/junctions.csv", "results/gnn/worst.png"],
        training=TRAINING_FILES,
        files=[file for name in SHOWN for file in for_structures(name)],
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
        library=library("build_report"),
        structures=RECONSTRUCTED,
        config=config,
    script:
        "../../scripts/build_report.py"
