import numpy as np
import pytest
from matplotlib.image import imread
from support import scans
from support.scans import affine_of, chest, full, grey, organ, write_nifti

from cccd.errors import InputError
from cccd.settings.imports import RegionSettings
from cccd_segmentation.regions import find_region
from cccd_viewers.regions import draw_region

REGION = {"window": "otsu", "components": 1, "smallest_share": 0.0, "drop_border": False, "fill_holes": False}


def load(folder, **region):
    return scans.load(folder, changes={"region": {**REGION, **region}}, image="image.nii")


@pytest.fixture
def folder(tmp_path):
    write_nifti(tmp_path / "image.nii", grey(organ()), affine_of())
    return tmp_path


def test_largest_component_only(folder):
    mask = organ()
    mask[32:] = False
    structure = load(folder)
    np.testing.assert_array_equal(full(structure), mask)
    low, high = structure.provenance["region"]["window"]
    assert -50 < low < 100
    assert high is None


@pytest.mark.parametrize("window", ["otsu", [20, None], [20, 200], [20.0, 1e6]])
def test_window(folder, window):
    np.testing.assert_array_equal(full(load(folder, components=2, window=window)), organ())


def test_lungs_in_a_chest():
    """Air around the patient is left out; lungs that are cut by the last slice stay; vessels are filled."""
    image, lungs = chest()
    image[:, :, :6][lungs[:, :, :6]] = 40
    lungs[:, :, :6] = False
    image[18:20, 24:26, 10:13] = 60
    image[29:31, 10:12, 8:10] = -900  # gas that is too small to be taken for a third
    found, _ = find_region(
        image, "x", RegionSettings(window=(None, -400), components=3, drop_border=True), slice_axis=2
    )
    np.testing.assert_array_equal(found, lungs)


def test_a_row_with_an_image_alone_says_that_it_is_a_threshold_and_has_no_labels(folder):
    assert any("no mask; the organ is found by a threshold" in note for note in load(folder).warnings)
    with pytest.raises(InputError, match=r"row 2: image.nii: .* has no label 'liver'; give"):
        scans.load(folder, image="image.nii", label="liver")


def test_picture(folder, tmp_path):
    draw_region(load(folder), tmp_path / "region.png")
    picture = imread(tmp_path / "region.png")
    red = (picture[..., 0] > 0.7) & (picture[..., 1] < 0.4) & (picture[..., 2] < 0.4)
    assert red.sum() > 500  # the outline
