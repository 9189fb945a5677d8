"""Junctions: synthetic training graphs -> the GNN that tells true links from false ones -> its scores."""


rule generate_graphs:
    """Draw the frozen training, validation and test graphs from synthetic contours, none of them a structure's."""
    output:
        "results/gnn/graphs.h5",
    log:
        "logs/gnn/generate_graphs.log",
    benchmark:
        "benchmarks/gnn/generate_graphs.tsv"
    priority: FIRST
    conda:
        "../../envs/cccd.yaml"
    threads: 1
    resources:
        mem_mb=memory(2000),
        runtime=minutes(20),
    params:
        library=library("generate_graphs"),
        settings=config["gnn"]["graphs"],
        seed=config["seed"],
    script:
        "../../scripts/generate_graphs.py"


if plan.junctions.trained:

    rule train_gnn:
        """Train link prediction (eq. 11); a checkpoint each epoch, so that a killed run goes on from there."""
        input:
            graphs="results/gnn/graphs.h5",
            start=plan.junctions.start,
        output:
            model=MODEL,
            history="results/gnn/history.csv",
        log:
            "logs/gnn/train_gnn.log",
        benchmark:
            "benchmarks/gnn/train_gnn.tsv"
        priority: FIRST
        conda:
            "../../envs/cccd.yaml"
        threads: 1  # two would idle through most of it, and the other core has comparisons to make
        resources:
            mem_mb=memory(4000),
            runtime=minutes(60),
        params:
            library=library("train_gnn", *plan.junctions.code(training=True)),
            settings=omit(
                "gnn",
                "pretrained",
                "start",
                "test_maps",
                "inference",
                *(["paper"] if plan.junctions.network == "ours" else []),
            ),
            checkpoints="results/gnn/checkpoints",
            seed=config["seed"],
        script:
            "../../scripts/train_gnn.py"

else:

    rule adopt_gnn:
        """Take a trained model: the one that the configuration names, otherwise the shipped one."""
        input:
            model=plan.junctions.ready,
        output:
            model=MODEL,
        log:
            "logs/gnn/adopt_gnn.log",
        benchmark:
            "benchmarks/gnn/adopt_gnn.tsv"
        conda:
            "../../envs/cccd.yaml"
        threads: 1
        resources:
            mem_mb=memory(1000),
            runtime=minutes(5),
        params:
            library=library("adopt_gnn", *plan.junctions.code()),
        script:
            "../../scripts/adopt_gnn.py"


rule evaluate_gnn:
    """Score the GNN and every classical decoder on the same corrupted maps, in one run."""
    input:
        models=list(plan.junctions.compared.values()),
    output:
        scores="results/tables/junctions.csv",
        worst="results/gnn/worst.png",
    log:
        "logs/gnn/evaluate_gnn.log",
    benchmark:
        "benchmarks/gnn/evaluate_gnn.tsv"
    conda:
        "../../envs/cccd.yaml"
    threads: 1
    resources:
        mem_mb=memory(3000),
        runtime=minutes(30),
    params:
        library=library("evaluate_gnn", *plan.junctions.code(paper=True, training=True)),
        names=list(plan.junctions.compared),
        settings=pick("gnn", "test_maps"),
        seed=config["seed"],
    script:
        "../../scripts/evaluate_gnn.py"
