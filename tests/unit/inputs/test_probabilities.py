"""Probabilities in: the surface follows their level of one half, below the pixel."""

import json
import pickle
import shutil
import zipfile
from pathlib import Path

import nibabel
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from support.refusals import refusal
from support.scans import affine_of, full, load, organ, write_nifti

import cccd
from cccd.containers import Frame, ProbabilityStack
from cccd.contours import level_curves
from cccd.errors import InputError
from cccd.inputs.row_files import list_labels
from cccd.store import read_structure, write_structure
from cccd_formats.nnunet import Classes

#: Background and two labels, by nnunetv2 2.8.1's own export (``export_prediction_from_logits``): the scan was
#: transposed for the network, cropped and resampled; and the label map that it wrote of it.
NNUNET = Path(__file__).parent / "nnunet"


def ball_fractions(radius=21.0, block=(3, 3, 6), shape=(20, 20, 10)):
    """Shares of voxels within a ball around the world's origin, and their affine."""
    size = np.array(block, float)
    affine = np.diag([*size, 1.0])
    affine[:3, 3] = (0.4, -0.7, 1.1) - size * (np.array(shape) - 1) / 2
    parts = 6
    fine = [
        affine[axis, 3] + size[axis] * ((np.arange(n * parts) + 0.5) / parts - 0.5)
        for axis, n in enumerate(shape)
    ]
    x, y, z = np.meshgrid(*fine, indexing="ij")
    inside = (x**2 + y**2 + z**2 <= radius**2).astype(np.float32)
    a, b, c = shape
    return inside.reshape(a, parts, b, parts, c, parts).mean((1, 3, 5)), affine


def test_the_level_runs_between_the_pixels():
    i, j = np.indices((40, 40), float)
    ramp = np.clip(0.5 + (11.3 - np.hypot(i - 19.2, j - 20.6)) / 4, 0, 1).astype(np.float32)
    stack = ProbabilityStack(np.stack([0 * ramp, ramp, ramp]), np.array([5, 100, 200]))
    curves = level_curves(stack, Frame(np.eye(4), 2, (300, 300, 20)))
    assert curves.slice.tolist() == [6, 7]
    assert not curves.hole.any()
    away = np.linalg.norm(curves.points - (119.2, 220.6), axis=1)
    assert np.abs(away - 11.3).max() < 0.08


def test_holes_are_holes_and_every_pixel_of_the_mask_is_enclosed():
    values = np.random.default_rng(3).random((4, 30, 30)).astype(np.float32)
    curves = level_curves(ProbabilityStack(values, np.zeros(3, int)), Frame(np.eye(4), 2, (30, 30, 4)))
    assert np.array_equal(curves.rasterise((0, 0, 0), values.shape), values >= 0.5)


def test_a_ball_is_a_ball_to_less_than_a_tenth_of_a_voxel():
    share, affine = ball_fractions()
    surface = cccd.reconstruct(share, affine)
    assert surface.mesh.is_watertight
    assert np.abs(np.linalg.norm(surface.vertices, axis=1) - 21).mean() < 0.17  # of 3 x 3 x 6 mm


def test_a_probability_map_is_read_with_its_mask_and_stored(tmp_path):
    share, affine = ball_fractions()
    write_nifti(tmp_path / "liver.nii.gz", share, affine)
    structure = load(tmp_path, mask="liver.nii.gz")
    assert np.array_equal(full(structure), share >= 0.5)
    write_structure(tmp_path / "structure.h5", structure)
    assert np.array_equal(read_structure(tmp_path / "structure.h5").probability, structure.probability)
    stack = read_structure(tmp_path / "structure.h5").probability_stack
    k, i, j = stack.origin
    assert 0 <= k < k + len(stack.values) <= share.shape[2]
    centre = stack.values[len(stack.values) // 2]
    here = share[max(i, 0) : i + centre.shape[0], max(j, 0) : j + centre.shape[1], k + len(stack.values) // 2]
    assert centre.max() == here.max() == 1
    assert np.isclose(centre.sum(), here.sum())


def test_the_probabilities_of_a_cut_mask_are_a_mask(tmp_path):
    write_nifti(tmp_path / "mask.nii", organ() * np.float32(0.9) + np.float32(0.05), affine_of())
    structure = load(tmp_path, mask="mask.nii")
    assert structure.probability is None
    assert any("as sharp as a mask" in note for note in structure.warnings)


def test_nnunet_probabilities_lie_where_its_own_label_map_lies():
    written = nibabel.load(NNUNET / "case.nii.gz")
    labels = np.asanyarray(written.dataobj)
    assert list_labels(NNUNET / "case.npz") == {"1": "liver", "2": "spleen"}
    for value, name in ((1, "liver"), (2, "spleen")):
        structure = load(NNUNET, mask="case.npz", label=name)
        np.testing.assert_allclose(structure.frame.affine, written.affine, atol=1e-5)
        assert structure.frame.shape == labels.shape
        assert np.array_equal(full(structure), labels == value)
        assert "case.pkl" in structure.provenance["files"]
        assert structure.probability.max() <= 1


def copied(folder):
    for file in NNUNET.iterdir():
        shutil.copy(file, folder)
    return folder


@given(
    elements=arrays(np.float32, (4, 2, 3, 2), elements=st.sampled_from(np.float32([0, 0.25, 0.5, 1]))),
    background=st.booleans(),
)
def test_a_label_is_measured_against_the_best_of_all_others(elements, background):
    values = {number + (not background): channel for number, channel in enumerate(elements)}
    classes = Classes(values, {}, np.eye(4), "map.npz")
    if background:
        best = elements.argmax(axis=0)
        assert classes.present() == {str(label): "" for label in np.unique(best) if label}
    for label in values.keys() - {0}:
        others = [channel for number, channel in values.items() if number != label]
        field = (1 + values[label] - np.max(others, axis=0)) / 2 if background else values[label]
        if (field >= 0.5).any():
            assert np.array_equal(classes.of_organ(str(label), "").data, field)
        else:
            assert "nowhere the most probable" in refusal(classes.of_organ, str(label), "")


def test_the_first_version_leaves_probabilities_cropped(tmp_path):
    share, affine = ball_fractions()
    box = [[2, 9], [3, 18], [4, 19]]  # z, y, x
    crop = share.T[tuple(slice(*side) for side in box)].astype(np.float16)
    np.savez_compressed(tmp_path / "case.npz", softmax=np.stack([1 - crop, crop]))
    lps = np.diag([-1, -1, 1, 1]) @ affine
    facts = {
        "crop_bbox": box,
        "original_size_of_raw_data": np.array(share.T.shape),
        "itk_spacing": (3.0, 3.0, 6.0),
        "itk_origin": tuple(lps[:3, 3]),
        "itk_direction": tuple((lps[:3, :3] / (3, 3, 6)).ravel()),
    }
    (tmp_path / "case.pkl").write_bytes(pickle.dumps(facts))
    structure = load(tmp_path, mask="case.npz")
    expected = np.zeros(share.shape, bool)
    x, y, z = (slice(*side) for side in box[::-1])
    expected[x, y, z] = share[x, y, z].astype(np.float16) >= 0.5
    assert np.array_equal(full(structure), expected)
    np.testing.assert_allclose(structure.frame.affine, affine)


class Trap:
    def __reduce__(self):
        return print, ("ran",)


def properties(held):
    """Writes other properties of the scan."""
    return lambda folder: (folder / "case.pkl").write_bytes(pickle.dumps(held))


def archive(**arrays):
    """Writes other arrays in the probabilities' place."""
    return lambda folder: np.savez(folder / "case.npz", **arrays)


def content(name, data):
    return lambda folder: (folder / name).write_bytes(data)


with np.load(NNUNET / "case.npz") as whole:
    HOLE = whole["probabilities"].copy()
HOLE[0, 0, 0, 0] = np.nan
ANOTHER = pickle.loads((NNUNET / "case.pkl").read_bytes()) | {"shape_before_cropping": (3, 4, 5)}
NO_ARCHIVE = "no probabilities of nnU-Net"
BAD = {
    "properties of another scan": (properties(ANOTHER), "voxels are not those of its .pkl"),
    "not a number": (archive(probabilities=HOLE), "no probabilities between 0 and 1"),
    "properties are text": (content("case.pkl", b"hello"), "not nnU-Net's properties of a scan"),
    "an empty archive": (
        lambda folder: zipfile.ZipFile(folder / "case.npz", "w").close(),
        "it contains nothing, no probabilities",
    ),
    "objects": (archive(probabilities=np.array([{}], object)), NO_ARCHIVE),
    "no properties": (
        lambda folder: (folder / "case.pkl").unlink(),
        "case.pkl, which says where it lies, is not next to it",
    ),
    "code in the properties": (properties({"sitk_stuff": Trap()}), "it asks for builtins.print"),
    "properties of nothing": (properties({"spacing": (1, 1, 1)}), "lacks the position of the probabilities"),
    "no archive": (content("case.npz", b"not a zip"), NO_ARCHIVE),
    "logits": (
        archive(probabilities=np.full((2, 3, 4, 5), 7.5, np.float32)),
        "no probabilities between 0 and 1",
    ),
    "another array": (archive(data=np.zeros((2, 3))), "it contains data, no probabilities"),
    "one channel of numbers": (
        archive(probabilities=np.zeros((3, 4, 5), np.float32)),
        "its probabilities are float32 of 3 x 4 x 5",
    ),
    "labels are no JSON": (content("dataset.json", b"labels"), "not nnU-Net's dataset.json"),
}


@pytest.mark.parametrize(("spoil", "said"), BAD.values(), ids=BAD)
def test_bad_nnunet_files_end_in_one_line(tmp_path, spoil, said, capsys):
    spoil(copied(tmp_path))
    with pytest.raises(InputError, match=said):
        load(tmp_path, mask="case.npz", label="1")
    assert "ran" not in capsys.readouterr().out


def test_a_label_that_is_nowhere_the_most_probable_is_refused(tmp_path):
    copied(tmp_path)
    (tmp_path / "dataset.json").write_text(json.dumps({"labels": {"background": 0, "liver": 1, "none": 2}}))
    with np.load(tmp_path / "case.npz") as held:
        channels = held["probabilities"].copy()
    channels[0] += channels[2]
    channels[2] = 0
    np.savez(tmp_path / "case.npz", probabilities=channels)
    assert "nowhere the most probable" in refusal(load, tmp_path, mask="case.npz", label="none")
