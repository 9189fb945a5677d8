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
        settings=pick("gnn", "graphs", "kind_weights"),
        seed=config["seed"],
    script:
        "../../scripts/generate_graphs.py"


#: What tells of the training; a model that is taken comes without.
TRAINING_FILES = ["results/gnn/graphs.h5", "results/gnn/history.csv"] if TRAINED else []

#: The paper's network where ours orders: it is trained beside, for the comparison.
PAPER_MODEL = "results/gnn/paper.pt"

#: What tells of the network's worth, where one is used.
JUNCTION_FILES = (
    ["results/tables/junctions.csv", "results/gnn/worst.png"] if NETWORKED else []
)

#: The models that are compared, by the names that the table gives them.
if ORDERS == "paper":
    COMPARED = {f"the paper's, {'trained here' if TRAINED else 'taken'}": MODEL}
elif TRAINED:
    COMPARED = {"trained here": MODEL, "the paper's, trained here": PAPER_MODEL}
else:
    COMPARED = {
        **({"pretrained": MODEL} if PRETRAINED else {}),
        "the paper's, shipped": SHIPPED_PAPER,
    }
COMPARED["shipped"] = SHIPPED

if TRAINED:

    rule train_gnn:
        """Train link prediction (eq. 11); a checkpoint each epoch, so that a killed run goes on from there."""
        input:
            graphs="results/gnn/graphs.h5",
            start=START,
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
            library=library("train_gnn"),
            settings=leave(
                "gnn",
                "pretrained",
                "start",
                "test_maps",
                *(["paper"] if ORDERS == "ours" else []),
            ),
            checkpoints="results/gnn/checkpoints",
            seed=config["seed"],
        script:
            "../../scripts/train_gnn.py"

    if ORDERS == "ours":

        rule train_paper_network:
            """Train the paper's network on the same graphs, to stand beside ours in the junction table."""
            input:
                graphs="results/gnn/graphs.h5",
                start=[],
            output:
                model=PAPER_MODEL,
                history="results/gnn/paper_history.csv",
            log:
                "logs/gnn/train_paper_network.log",
            benchmark:
                "benchmarks/gnn/train_paper_network.tsv"
            conda:
                "../../envs/cccd.yaml"
            threads: 1
            resources:
                mem_mb=memory(2000),
                runtime=minutes(20),
            params:
                library=library("train_gnn"),
                settings={
                    **pick("gnn", "paper", "inference", "optimiser"),
                    "network": "paper",
                },
                checkpoints="results/gnn/paper_checkpoints",
                seed=config["seed"],
            script:
                "../../scripts/train_gnn.py"

else:

    rule adopt_gnn:
        """Take a trained model: the one that the configuration names, otherwise the shipped one."""
        input:
            model=READY,
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
            library=library("adopt_gnn"),
        script:
            "../../scripts/adopt_gnn.py"


rule evaluate_gnn:
    """Score the GNN and every classical decoder on the same corrupted maps, in one run."""
    input:
        models=list(COMPARED.values()),
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
        library=library("evaluate_gnn"),
        names=list(COMPARED),
        settings=pick("gnn", "test_maps"),
        seed=config["seed"],
    script:
        "../../scripts/evaluate_gnn.py"
