"""Which networks a run trains, takes and compares, and what it refuses."""

import shutil

import pytest
from support import plans
from support.refusals import refusal

from cccd_workflow.plan.networks import MODEL
from cccd_workflow.plan.plan import Plan

plan_of, ROOT = plans.plan_of, plans.ROOT

MODELS = ROOT / "workflow" / "models"
MASK = {"case": "a", "organ": "ball", "mask": "mask.nii.gz"}
MAPS = {"case": "b", "organ": "ball", "boundary": "maps.nii.gz"}
TRAIN = {"case": "t", "organ": "ball", "image": "i.nii.gz", "mask": "m.nii.gz", "role": "train"}


def test_the_default_cohort_trains_and_others_take_the_shipped_model():
    default, other = Plan.make({}, ROOT).junctions, plan_of(MAPS).junctions
    assert default.trained
    assert default.training_files == ["results/gnn/graphs.h5", "results/gnn/history.csv"]
    assert not other.trained
    assert other.training_files == []
    assert other.ready == str(MODELS / "junctions.pt")
    assert not Plan.make({"train": False}, ROOT).junctions.trained
    assert plan_of(MAPS, train=True).junctions.trained


def test_masks_alone_use_no_network_unless_one_is_named():
    assert not plan_of(MASK).junctions.used
    for used in (plan_of(MASK, MAPS), plan_of(MASK, train=True), named_model("named.pt", MASK)):
        assert used.junctions.used


def test_networks_are_scored_where_one_is_made_or_named_or_comparisons_are_asked_for():
    for unscored in (plan_of(MASK, compare=True), plan_of(MAPS)):
        assert unscored.junctions.score_files == []
    compared = (plan_of(MAPS, compare=True), plan_of(MASK, train=True), named_model("named.pt", MASK))
    for scored in compared:
        assert "results/tables/junctions.csv" in scored.junctions.score_files


def named_model(name, *rows, **config):
    """Plan with a model of that name in the folder of the run."""
    shutil.copy(MODELS / "junctions.pt", name)
    return plan_of(*rows, gnn={"pretrained": name}, **config)


def test_a_named_model_is_taken_from_where_the_run_is():
    junctions = named_model("mine.pt", MAPS).junctions
    assert junctions.ready == "mine.pt"
    assert junctions.compared == {
        "pretrained": MODEL,
        "the paper's, shipped": str(MODELS / "paper.pt"),
        "shipped": str(MODELS / "junctions.pt"),
    }


def test_the_models_that_are_compared():
    shipped = str(MODELS / "junctions.pt")
    trained, paper, paper_trained = (
        plan_of(MAPS, **config).junctions.compared
        for config in (
            {"train": True},
            {"gnn": {"network": "paper"}},
            {"train": True, "gnn": {"network": "paper"}},
        )
    )
    assert trained == {
        "trained here": MODEL,
        "the paper's, shipped": str(MODELS / "paper.pt"),
        "shipped": shipped,
    }
    assert paper == {"the paper's, taken": MODEL, "shipped": shipped}
    assert paper_trained == {"the paper's, trained here": MODEL, "shipped": shipped}


def test_only_another_package_s_network_brings_code():
    assert plan_of(MAPS).junctions.code() == []
    (path,) = plan_of(MAPS, gnn={"network": "paper"}).junctions.code()
    assert not path.startswith("cccd.")


@pytest.mark.parametrize(
    ("config", "line"),
    [
        (
            {"train": True, "gnn": {"pretrained": "mine.pt"}},
            "config keys train and gnn.pretrained: a model is to be trained, but mine.pt is named; ",
        ),
        ({"gnn": {"start": "mine.pt"}}, "config key gnn.start: nothing is trained in this run; "),
        ({"train": True, "gnn": {"start": "no.pt"}}, "config key gnn.start: there is no file no.pt; "),
        ({"gnn": {"pretrained": "no.pt"}}, "config key gnn.pretrained: there is no file no.pt; "),
        ({"gnn": {"pretrained": "sheet.tsv"}}, "sheet.tsv: not a junction model of this version"),
        (
            {"gnn": {"pretrained": str(MODELS / "paper.pt")}},
            f"{MODELS / 'paper.pt'}: ",
        ),
    ],
)
def test_a_model_that_cannot_be_used_is_refused_before_any_job(config, line):
    shutil.copy(MODELS / "junctions.pt", "mine.pt")
    assert refusal(plan_of, MAPS, **config).startswith(line)


def test_a_network_s_name_means_the_weights_that_the_sheet_trains():
    segmenter = plan_of(TRAIN, segmenter="nnunet", segmentation={"labels": [3, 5]}).segmenter
    assert segmenter.weights == ("results/segmenters/nnunet/model.pt",)
    assert segmenter.labels == "3,5"
    assert segmenter.code == ("cccd_segmentation.plain_unet.PlainUNet",)
    assert plan_of(TRAIN, segmenter="nnunet").segmenter.labels == "1"


def test_a_file_of_weights_says_what_it_is():
    path = MODELS / "segmenters" / "hippocampus" / "nnunet.pt"
    segmenter = plan_of(MASK, segmenter=str(path)).segmenter
    assert segmenter.weights == (str(path),)
    assert segmenter.labels == "1,2"
    assert segmenter.code == ("cccd_segmentation.plain_unet.PlainUNet",)


def test_an_installed_program_has_no_weights_here():
    segmenter = plan_of(MASK, segmenter="totalsegmentator").segmenter
    assert segmenter.is_installed
    assert (segmenter.weights, segmenter.labels, segmenter.code) == ((), "1", ())
    assert not plan_of(MASK).segmenter.is_installed


@pytest.mark.parametrize(
    ("name", "line"),
    [
        ("nnunet", "config key segmenter: nnunet is to be trained, and sheet.tsv has no row of role train; "),
        (
            "nnunett",
            "config key segmenter: there is neither a network nor a file nnunett; did you mean 'nnunet'?",
        ),
        ("sheet.tsv", "sheet.tsv: not a segmentation network of this version"),
    ],
)
def test_a_segmenter_that_cannot_be_used_is_refused_before_any_job(name, line):
    assert refusal(plan_of, MASK, segmenter=name).startswith(line)
