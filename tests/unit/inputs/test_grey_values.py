"""Grey images given as masks are refused; whatever is a label map passes, however many labels it has."""

import time

import nibabel
import numpy as np
import pytest
from scipy import ndimage
from scipy.spatial import cKDTree
from support.refusals import refusal
from support.scans import DATA, affine_of, load, write_nifti

import cccd
from cccd.errors import InputError
from cccd.inputs.labels import refuse_grey_values
from cccd.inputs.row_files import list_labels

RANDOM = np.random.default_rng(0)
AT = np.indices((64, 60, 40))
DISTANCE = np.linalg.norm(AT.T - (32, 30, 20), axis=-1).T


def noisy_mr():
    """8 bits, background that is nearly constant, three tissues, noise."""
    tissue = 40 + 60 * (DISTANCE < 18) + 70 * (DISTANCE < 12)
    return np.where(DISTANCE < 24, tissue + RANDOM.normal(0, 6, AT[0].shape), 2).clip(0, 255).astype(np.uint8)


def smooth_mr():
    return ndimage.gaussian_filter(noisy_mr().astype(float), 2).astype(np.uint8)


def blocks(numbers):
    return numbers.repeat(2, 0).repeat(2, 1).repeat(2, 2)


def cells(count):
    """Voronoi cells of random points, with numbers up to 14175, as of FreeSurfer's parcels."""
    nearest = cKDTree(RANDOM.random((count, 3)) * AT[0].shape).query(AT.reshape(3, -1).T)[1]
    return np.sort(RANDOM.choice(np.arange(1, 14176), count, replace=False))[nearest].reshape(AT[0].shape)


GREY = {
    "MR of 8 bits": noisy_mr(),
    "smooth MR": smooth_mr(),
    "padded MR": np.pad(noisy_mr().astype(np.int16) + 3, 30, constant_values=24),
    "CT": (40 + 400 * (DISTANCE < 20) + RANDOM.normal(0, 20, AT[0].shape) - 500).astype(np.int16),
    "CT of air alone": np.where(DISTANCE < 20, -300, -1000),
    "CT without noise": np.where(DISTANCE < 20, 40, -1000).astype(np.int16),
    "float of whole numbers": np.rint(smooth_mr() * 3.7).astype(np.float32),
    "a steep ramp": 3 * AT[0] + 2 * AT[1],
    "a shallow ramp": (AT[0] // 2 + AT[1] // 2 + AT[2] // 2).astype(np.uint8) + 1,
    "distances": DISTANCE.astype(np.int32) * 2 + 1 + (DISTANCE * 10).astype(np.int32),
}
NOISE = {
    "half of it": RANDOM.random(AT[0].shape) < 0.5,
    "a tenth": RANDOM.random(AT[0].shape) < 0.1,
    "most of it": RANDOM.random(AT[0].shape) < 0.9,
    "float": (RANDOM.random(AT[0].shape) < 0.5).astype(np.float32),
    "several labels": RANDOM.integers(1, 12, AT[0].shape),
    "several labels and background": RANDOM.integers(0, 12, AT[0].shape),
    "components of noise": ndimage.label(RANDOM.random(AT[0].shape) < 0.2)[0],
}
LABELS = {
    "every other voxel of an organ": np.where(DISTANCE < 20, (AT.sum(axis=0) % 2 == 0) | (AT[0] % 3 == 0), 0),
    "some slices": (DISTANCE < 24) & (AT[2] % 4 == 0),
    "a plane that fills nearly all": AT[0] > 2,
    "all of it": np.ones(AT[0].shape, int),
    "three shells": np.where(abs(DISTANCE - 18) < 1.5, np.rint(DISTANCE - 16).astype(int), 0),
    "255 in a mask": 255 * (DISTANCE < 20),
    "190 parcels": cells(190),
    "1,000 parcels on a shell": np.where(abs(DISTANCE - 17) < 1, cells(1000), 0),
    "5,000 tiny ones that touch": blocks(RANDOM.permutation(5000).reshape(20, 25, 10) + 1),
    "5,000 in order": blocks(np.arange(5000).reshape(20, 25, 10) + 1),
    "5,000 single voxels": np.where((AT % 3 == 0).all(axis=0), np.arange(AT[0].size).reshape(AT[0].shape), 0),
    "vertebrae": np.where(DISTANCE < 25, AT[2] // 2 + 1, 0),
    "not looked at": cells(30) * np.where(DISTANCE < 20, 1, 0) - (AT[0] == 0),
}


@pytest.mark.parametrize("image", GREY.values(), ids=GREY)
def test_grey_values_are_refused_with_what_to_do(tmp_path, image):
    write_nifti(tmp_path / "mask.nii", np.asarray(image, np.float32), affine_of())
    for read in (
        lambda: load(tmp_path, mask="mask.nii"),
        lambda: load(tmp_path, mask="mask.nii", label="40"),
        lambda: list_labels(tmp_path / "mask.nii"),
        lambda: cccd.reconstruct(image),
    ):
        with pytest.raises(
            InputError, match=r"mask.*grey values, -?\d+ to -?\d+, not labels; give the organ's"
        ):
            read()


@pytest.mark.parametrize("labels", LABELS.values(), ids=LABELS)
def test_label_maps_pass(labels):
    refuse_grey_values(labels.astype(np.int32), "labels")


@pytest.mark.parametrize("mask", NOISE.values(), ids=NOISE)
def test_noise_is_refused(mask):
    with pytest.raises(InputError, match=r"mask: (noise: its voxels|grey values, [01] to 11, not labels)"):
        cccd.reconstruct(mask)


def scaled(image):
    """Grey values from 0 to 1."""
    low, high = np.percentile(image, (1, 99))
    return ((image - low) / (high - low)).clip(0, 1)


def logistic(values):
    return 1 / (1 + np.exp(-values))


FRACTIONS = {
    "MR": scaled(noisy_mr().astype(float)),
    "CT in a window": scaled(40 + 30 * (DISTANCE < 20) + RANDOM.normal(0, 20, AT[0].shape)),
    "noise": RANDOM.random(AT[0].shape),
}
INSIDE = 20 - DISTANCE
PROBABILITIES = {
    "a smoothed mask": ndimage.gaussian_filter((INSIDE > 0).astype(float), 1),
    "a wide slope": logistic(INSIDE / 4),
    "unsure throughout": 0.2 + 0.6 * logistic(INSIDE / 4),
    "noisy at its border": logistic(INSIDE + RANDOM.normal(0, 1, AT[0].shape)),
    "the share of five raters": np.mean([INSIDE + shift > 0 for shift in (-2, -1, 0, 1, 2)], axis=0),
    "a crop of a small organ": logistic(INSIDE / 2 + RANDOM.normal(0, 1, AT[0].shape))[12:30, 20:40, 10:30],
    "a little above 1": 1.0001 * ndimage.gaussian_filter((INSIDE > 0).astype(float), 1),
    "a little below 0": logistic(INSIDE) - 1e-5,
}


@pytest.mark.parametrize("image", FRACTIONS.values(), ids=FRACTIONS)
def test_grey_values_scaled_to_1_are_no_probabilities(image):
    with pytest.raises(InputError, match=r"mask: grey values, \S+ to 1, not probabilities; give the organ's"):
        cccd.reconstruct(image)


@pytest.mark.parametrize("chance", PROBABILITIES.values(), ids=PROBABILITIES)
def test_probabilities_pass(tmp_path, chance):
    write_nifti(tmp_path / "chance.nii", chance.astype(np.float32), affine_of())
    probability = cccd.read(tmp_path / "chance.nii").probability
    assert probability.max() == pytest.approx(min(chance.max(), 1))
    assert probability.min() == 0  # in the margin, and where it was a little below


@pytest.mark.skipif(not DATA.is_dir(), reason="the real scans are not at ../shared/data")
@pytest.mark.parametrize("number", ["001", "011", "101"])
def test_real_images_scaled_to_1_are_refused(number):
    image = nibabel.load(DATA / f"hippocampus_msd/images/hippocampus_{number}.nii.gz").get_fdata()
    assert "not probabilities" in refusal(cccd.reconstruct, scaled(image))


def test_it_takes_less_than_a_second():
    image = np.asfortranarray(RANDOM.normal(300, 30, (512, 512, 1)).astype(np.int16).repeat(300, 2))
    began = time.process_time()
    assert "grey values" in refusal(refuse_grey_values, image, "image")
    assert time.process_time() - began < 1


@pytest.mark.skipif(not DATA.is_dir(), reason="the real scans are not at ../shared/data")
@pytest.mark.parametrize("command", ["surface", "check"])
@pytest.mark.parametrize(
    "image",
    [
        "brain_tcga_du7294/t1.nii.gz",
        "liver_totalseg_ct3mm/image.nii.gz",
        "lung_cip64/image.nrrd",
        "hippocampus_msd/images/hippocampus_001.nii.gz",
        "hippocampus_msd/images/hippocampus_091.nii.gz",
    ],
)
def test_real_images_are_refused(image, command, here, refused):
    line = refused(command, DATA / image)
    assert image.rsplit("/", 1)[1] in line
    assert "--image" in line
    assert not list(here.iterdir())


@pytest.mark.skipif(not DATA.is_dir(), reason="the real scans are not at ../shared/data")
def test_real_label_maps_pass():
    for path in (
        *DATA.glob("*/*label*.n*"),
        *DATA.glob("*/mask*.n*"),
        *DATA.glob("hippocampus_msd/labels/*"),
    ):
        assert list_labels(path)
