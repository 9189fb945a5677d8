"""Segmentation: training scans -> networks -> masks of the rows that have an image alone."""


wildcard_constraints:
    network="|".join(networks()),


rule segmenters:
    """Every segmentation network, trained on the sheet's rows of role train."""
    input:
        expand("results/segmenters/{network}/model.pt", network=networks()),
    localrule: True


rule train_segmenter:
    """Train a segmentation network; a checkpoint each epoch, so that a killed run goes on from there."""
    input:
        cohort.training_files,
    output:
        model="results/segmenters/{network}/model.pt",
        history="results/segmenters/{network}/history.csv",
        scores="results/segmenters/{network}/scores.csv",
        curve="results/segmenters/{network}/learning_curve.png",
    log:
        "logs/segmenters/{network}.log",
    benchmark:
        "benchmarks/segmenters/{network}.tsv"
    conda:
        "../../envs/cccd.yaml"
    threads: 1  # the same weights whatever the cores, and networks train side by side
    resources:
        mem_mb=memory(4000, 4),
        runtime=minutes(60),
    params:
        library=lambda wildcards: library(
            "train_segmenter", networks()[wildcards.network].build, *plan.readers
        ),
        rows=plan.training_rows,
        sheet_folder=plan.sheet_folder,
        settings=config["segmentation"],
        reading=config["import"],
        checkpoints="results/segmenters/{network}/checkpoints",
        seed=config["seed"],
    script:
        "../../scripts/train_segmenter.py"


rule segment_structure:
    """Find the organ in a scan without a mask, by the configured segmenter, on the scan's own grid."""
    input:
        scan=cohort.source_files,
        model=plan.segmenter.weights,
    output:
        labels="results/{case}/{organ}/segmentation.nii.gz",
        probabilities="results/{case}/{organ}/probabilities.nii.gz",
        report="results/{case}/{organ}/segmentation.json",
    log:
        "logs/{case}/{organ}/segment_structure.log",
    benchmark:
        "benchmarks/{case}/{organ}/segment_structure.tsv"
    group:
        "import"
    conda:
        "../../envs/cccd.yaml"
    threads: 1
    resources:
        mem_mb=memory(2500, 40),
        runtime=minutes(30),
    params:
        library=library("segment_structure", *plan.segmenter.code, *plan.readers),
        row=cohort.row,
        sheet_folder=plan.sheet_folder,
        segmenter=plan.segmenter.name,
        reading=config["import"],
        seed=config["seed"],
    script:
        "../../scripts/segment_structure.py"
