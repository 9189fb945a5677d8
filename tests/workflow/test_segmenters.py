"""Segmentation networks train through the workflow, and what they are compared with follows their files."""

import pandas as pd
import pytest

pytest.importorskip("monai")

from cccd_segmentation.model import load_segmenter

SHEET = """case\torgan\tsource\trole
train_1\tkidney\tphantom\ttrain
train_2\tkidney\tphantom\ttrain
"""


def test_a_network_is_trained_and_scored(fresh_project):
    (fresh_project.folder / "train.tsv").write_text(SHEET)
    settings = {
        "cohort": "train.tsv",
        "import": "{phantom: {spacing_mm: [6, 6, 6]}}",
        "segmentation": "{spacing_mm: [6, 6, 6], patch: [32, 32, 32], width: 2, epochs: 2, test_share: 0.5}",
    }
    target = "results/segmenters/nnunet/model.pt"
    command = ["--config", *(f"{key}={value}" for key, value in settings.items()), "--", target]
    fresh_project.snakemake(*command)
    folder = fresh_project.results / "segmenters" / "nnunet"
    _, plan = load_segmenter(folder / "model.pt")
    assert (plan.organ, plan.width, plan.spacing) == ("kidney", 2, (6, 6, 6))
    assert plan.intensity.modality == "CT"
    assert len(pd.read_csv(folder / "history.csv")) == 2
    assert pd.read_csv(folder / "scores.csv")["patient"].isin(["train_1", "train_2"]).sum() == 1
    assert (folder / "learning_curve.png").stat().st_size > 1000


def test_other_weights_bring_the_comparison_back(fresh_project):
    """Planned only: the job of the phantom's liver has the shipped networks among its inputs."""
    (fresh_project.folder / "one.tsv").write_text("case\torgan\tsource\nphantom\tliver\tphantom\n")
    target = "results/phantom/liver/comparisons/segmenters.csv"
    told = fresh_project.snakemake("--dry-run", "--config", "cohort=one.tsv", "--", target).stdout
    assert "phantom_liver/nnunet.pt" in told
