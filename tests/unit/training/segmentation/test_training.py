"""Splits, plans, resumed trainings, files of weights, and probabilities on the scan's own grid."""

import logging
import shutil
from dataclasses import replace

import numpy as np
import pytest
import torch
from support.refusals import refusal

from cccd.errors import InputError
from cccd.inputs.grid import Volume
from cccd.inputs.readers import read_volume
from cccd_segmentation.grids import WorkingGrid
from cccd_segmentation.inference import labels_of, probabilities
from cccd_segmentation.model import load_segmenter, save_segmenter
from cccd_segmentation.networks import NETWORKS, Network
from cccd_segmentation.segment import segment, write_segmentation
from cccd_segmentation.settings import SegmentationSettings
from cccd_training.segmentation.examples import LabelledScan, make_plan, split_patients
from cccd_training.segmentation.training import score_held_out, train_segmenter

SETTINGS = SegmentationSettings(
    epochs=12, width=8, patch=(32, 32, 32), precision="float32", learning_rate=0.01
)


def ball(patient, seed, affine=None):
    """A bright ball in noise, somewhere in a scan of 36 x 32 x 32 voxels."""
    rng = np.random.default_rng(seed)
    centre, radius = rng.uniform(13, 20, 3), rng.uniform(6, 9)
    points = np.stack(np.meshgrid(*map(np.arange, (36, 32, 32)), indexing="ij"), axis=-1)
    labels = (np.linalg.norm(points - centre, axis=-1) < radius).astype(np.uint8)
    image = 100 * labels + rng.normal(50, 20, labels.shape)
    return LabelledScan(patient, Volume(image, np.eye(4) if affine is None else affine, patient), labels)


SCANS = [ball(f"p{number}", number) for number in range(5)]


@pytest.fixture(scope="module")
def checkpoints(tmp_path_factory):
    return tmp_path_factory.mktemp("checkpoints")


@pytest.fixture(scope="module")
def trained(checkpoints):
    return train_segmenter(SCANS, "nnunet", SETTINGS, 3, checkpoints, organ="ball")


def test_no_patient_is_on_both_sides_of_the_split():
    scans = [ball(f"p{number // 3}", number) for number in range(30)]
    training, held = split_patients(scans, 0.2, seed=5)
    assert {scan.patient for scan in training}.isdisjoint(scan.patient for scan in held)
    assert len(training) + len(held) == 30
    assert len({scan.patient for scan in held}) == 2
    assert "it has 1 patient" in refusal(split_patients, scans[:3], 0.2, seed=5)


def test_scans_of_two_modalities_are_refused():
    other = ball("p9", 9)
    cold = LabelledScan("p9", Volume(other.image.data - 1000, np.eye(4), ""), other.labels)
    with pytest.raises(InputError, match="1 of 6 scans look like CT"):
        make_plan([*SCANS, cold], "nnunet", 8, {}, SETTINGS, "ball", 0)


def test_it_learns_and_a_resumed_training_has_the_same_weights(trained, checkpoints, tmp_path):
    assert trained.history["dice"].iloc[-1] > 0.8
    before_last, _ = sorted(checkpoints.glob("epoch_*.pt"))
    shutil.copy(before_last, tmp_path)  # as if it had been killed in its last epoch
    resumed = train_segmenter(SCANS, "nnunet", SETTINGS, 3, tmp_path, organ="ball")
    for name, value in trained.model.state_dict().items():
        assert torch.equal(value, resumed.model.state_dict()[name]), name
    assert resumed.history["dice"].tolist() == trained.history["dice"].tolist()


class Brittle(torch.nn.Module):
    """One convolution, whose third step has a gradient that is no number though its loss is one."""

    def __init__(self, classes, width):
        super().__init__()
        self.conv, self.steps = torch.nn.Conv3d(1, classes, 1), 0

    def forward(self, volume):
        return self.conv(volume)

    def outputs(self, volume, labels):
        self.steps += 1
        nothing = torch.sqrt(0 * self.conv.weight.sum()) if self.steps == 3 else 0
        return [(self.conv(volume) + nothing, labels)]


def test_a_step_without_a_finite_gradient_is_left_out_and_told(tmp_path, monkeypatch, caplog):
    monkeypatch.setitem(NETWORKS, "brittle", Network("Brittle", f"{__name__}.Brittle", 1, 1))
    settings = SETTINGS.model_copy(update={"epochs": 2})
    with caplog.at_level(logging.WARNING):
        model = train_segmenter(SCANS, "brittle", settings, 3, tmp_path).model
    assert all(bool(torch.isfinite(weight).all()) for weight in model.parameters())
    (line,) = [record.getMessage() for record in caplog.records if "finite" in record.getMessage()]
    assert line.startswith("epoch 1:")


def test_weights_in_half_precision_give_the_same_scores(trained, tmp_path):
    save_segmenter(tmp_path / "model.pt", trained.model, trained.plan)
    model, plan = load_segmenter(tmp_path / "model.pt")
    assert plan == trained.plan
    assert (tmp_path / "model.pt").stat().st_size < 2.2 * sum(p.numel() for p in model.parameters()) + 1e5
    scores = score_held_out(tmp_path / "model.pt", SCANS, SETTINGS, 3)
    assert scores["dice"].mean() == pytest.approx(trained.history["dice"].iloc[-1], abs=0.01)
    assert scores["hd95_mm"].max() < 6


@pytest.mark.parametrize("axes", ["RAS", "LIP", "SAR"])
def test_what_goes_to_the_working_grid_comes_back_to_the_scan_s(axes, trained):
    import nibabel as nib

    turn = nib.orientations.ornt_transform(
        nib.orientations.axcodes2ornt("RAS"), nib.orientations.axcodes2ornt(tuple(axes))
    )
    scan = ball("p", 1, np.diag([1.5, 1.5, 1.5, 1.0]))
    data = nib.orientations.apply_orientation(scan.labels, turn)
    affine = scan.image.affine @ nib.orientations.inv_ornt_aff(turn, scan.labels.shape)
    grid = WorkingGrid(affine, "RAS", (1.2, 1.7, 1.4))
    moved = grid.forward(data)
    back = grid.backward(moved, data.shape)[0].numpy() > 0.5
    assert back.shape == data.shape
    assert 2 * (back & (data > 0)).sum() / (back.sum() + data.sum()) > 0.93
    straight = WorkingGrid(scan.image.affine, "RAS", (1.2, 1.7, 1.4)).forward(scan.labels)
    assert moved.shape == straight.shape
    assert (moved - straight).abs().max() < 1e-4


class ShortOfMemory(torch.nn.Module):
    """A network that a device holds for so many windows at once."""

    def __init__(self, model, most):
        super().__init__()
        self.model, self.most, self.batches = model, most, []

    def forward(self, windows):
        if len(windows) > self.most:
            raise torch.OutOfMemoryError
        self.batches.append(len(windows))
        return self.model(windows)


def test_fewer_windows_go_at_once_where_memory_is_short(trained):
    scan = SCANS[0].image
    wide = probabilities(trained.model, scan, trained.plan)
    tight = ShortOfMemory(trained.model, most=1)
    assert abs(probabilities(tight, scan, trained.plan) - wide).max() < 1e-4
    assert max(tight.batches) == 1
    with pytest.raises(torch.OutOfMemoryError):
        probabilities(ShortOfMemory(trained.model, most=0), scan, trained.plan)


def test_half_precision_finds_the_same_labels(trained):
    whole_scan = SCANS[0].image
    scan = Volume(whole_scan.data[:32, :32, :32], whole_scan.affine, "one window")
    whole = labels_of(probabilities(trained.model, scan, trained.plan), trained.plan)
    with torch.autocast("cpu", torch.float16):  # as predict does on a GPU
        half = labels_of(probabilities(trained.model, scan, trained.plan), trained.plan)
    assert (whole != half).sum() <= 0.001 * (whole > 0).sum()


def test_a_scan_in_another_orientation_gets_the_same_mask(trained, tmp_path):
    save_segmenter(tmp_path / "model.pt", trained.model, trained.plan)
    scan = SCANS[0].image
    flipped = Volume(
        np.flip(scan.data, 0).transpose(2, 0, 1).copy(),
        scan.affine @ np.array([[0, -1, 0, 35], [0, 0, 1, 0], [1, 0, 0, 0], [0, 0, 0, 1.0]]),
        "flipped",
    )
    one, other = (segment(volume, tmp_path / "model.pt", "ball") for volume in (scan, flipped))
    assert not one.warnings
    assert (np.flip(other.labels.transpose(1, 2, 0), 0) == one.labels).mean() > 0.9999
    names = [str(tmp_path / name) for name in ("labels.nii.gz", "chances.nii.gz", "report.json")]
    write_segmentation(other, *names)
    written = read_volume(tmp_path / "labels.nii.gz")
    assert written.shape == flipped.shape
    np.testing.assert_allclose(written.affine, flipped.affine)


def test_another_modality_and_another_spacing_are_warned_of_with_both(trained, tmp_path):
    save_segmenter(tmp_path / "model.pt", trained.model, trained.plan)
    scan = SCANS[0].image
    strange = Volume(10 * scan.data - 1000, np.diag([3.0, 3.0, 3.0, 1.0]), "strange.nii")
    notes = trained.plan.differences(strange)
    assert notes[0] == "strange.nii looks like CT, and the segmenter was trained on MR"
    assert "voxels of 3 x 3 x 3 mm" in notes[1]
    assert "1 x 1 x 1 mm" in notes[1]
    assert "not a segmentation network of this version" in refusal(segment, scan, __file__, "ball")


def test_other_grey_values_and_weights_of_phantoms_are_warned_of(trained):
    scan = SCANS[0].image
    assert trained.plan.differences(scan) == []
    much_air = Volume(np.pad(scan.data, 20), scan.affine, "head.nii")
    (note,) = trained.plan.differences(much_air)
    assert "head.nii has other grey values than the segmenter was trained on" in note
    (note,) = replace(trained.plan, source="phantom").differences(scan)
    assert "trained on phantoms" in note


def test_a_file_of_another_network_is_refused(trained, tmp_path):
    save_segmenter(
        tmp_path / "model.pt", trained.model, replace(trained.plan, network="unet_3plus", sizes={})
    )
    assert "its weights are not those of unet_3plus" in refusal(load_segmenter, tmp_path / "model.pt")
