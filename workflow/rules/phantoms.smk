"""Phantoms as a folder of files: `snakemake phantoms`. Nothing else reads them."""

PHANTOMS = "results/phantoms"


rule phantoms:
    """Every phantom as files that others can use as a benchmark: scans, true surface, table, licence."""
    input:
        tables=[
            f"{PHANTOMS}/{organ}/scan_{mm}mm.csv"
            for organ in PHANTOM_ORGANS
            for mm in PHANTOM_DISTANCES_MM
        ],
        text=near(ROOT / "workflow" / "phantoms.md"),
        licence=near(ROOT / "LICENSE"),
    output:
        table=f"{PHANTOMS}/phantoms.csv",
        text=f"{PHANTOMS}/README.md",
        licence=f"{PHANTOMS}/LICENSE",
    log:
        "logs/phantoms.log",
    benchmark:
        "benchmarks/phantoms.tsv"
    conda:
        "../../envs/cccd.yaml"
    threads: 1
    resources:
        mem_mb=memory(1000),
        runtime=minutes(5),
    params:
        library=library("gather_phantoms"),
    script:
        "../../scripts/gather_phantoms.py"


rule write_phantom:
    """One phantom: its true surface, and its scan for every slice distance."""
    output:
        truth=f"{PHANTOMS}/{{organ}}/truth.ply",
        images=[
            f"{PHANTOMS}/{{organ}}/image_{mm}mm.nii.gz" for mm in PHANTOM_DISTANCES_MM
        ],
        masks=[
            f"{PHANTOMS}/{{organ}}/mask_{mm}mm.nii.gz" for mm in PHANTOM_DISTANCES_MM
        ],
        tables=[f"{PHANTOMS}/{{organ}}/scan_{mm}mm.csv" for mm in PHANTOM_DISTANCES_MM],
    log:
        "logs/phantoms/{organ}.log",
    benchmark:
        "benchmarks/phantoms/{organ}.tsv"
    conda:
        "../../envs/cccd.yaml"
    threads: 1
    resources:
        mem_mb=memory(3000),
        runtime=minutes(15),
    params:
        library=library("write_phantom"),
        distances=PHANTOM_DISTANCES_MM,
        spacing_mm=config["import"]["phantom"]["spacing_mm"],
        seed=config["seed"],
    script:
        "../../scripts/write_phantom.py"
