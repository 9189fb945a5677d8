import numpy as np
import pytest
from scans import affine_of, row, settings, write_nifti
from scipy import ndimage

from cccd.errors import InputError
from cccd.inputs import load_structure
from cccd.inputs.grid import crop
from cccd.inputs.refining import refine_border
from cccd.metrics import dice

I_, J_ = np.indices((80, 80)) - 39.6
RADIUS = 22.3
TRUE = np.hypot(I_, J_) < RADIUS


def stack(slice_):
    return np.repeat(slice_[:, :, None], 6, axis=2)


def scan(inside=100.0, outside=0.0, noise=5.0):
    """A disc below the pixel, blurred by less than a pixel, with noise."""
    share = np.clip(RADIUS - np.hypot(I_, J_) + 0.5, 0, 1)
    clean = stack(ndimage.gaussian_filter(outside + (inside - outside) * share, 0.8))
    return (clean + np.random.default_rng(0).normal(0, noise, clean.shape)).astype(np.float32)


def rough(by=1.2):
    """A mask whose border is off by up to so many pixels, in and out."""
    angle = np.arctan2(J_, I_)
    return stack(np.hypot(I_, J_) < RADIUS + by * np.sin(7 * angle))


def off(probability):
    """Mean distance of the border from the true circle, pixels."""
    border = []
    for angle in np.linspace(0, 2 * np.pi, 360, endpoint=False):
        along = np.linspace(RADIUS - 4, RADIUS + 4, 161)
        at = np.array([along * np.cos(angle), along * np.sin(angle)]) + 39.6
        values = ndimage.map_coordinates(probability[:, :, 3].astype(float), at, order=1)
        border.append(along[np.flatnonzero(values >= 0.5)[-1]])
    return np.abs(np.array(border) - RADIUS).mean()


@pytest.mark.parametrize(("inside", "outside"), [(100, 0), (-850, 40), (40, -100)])
def test_the_border_moves_to_the_edge_below_the_pixel(inside, outside):
    found = refine_border(scan(inside, outside), rough(), 2)
    assert off(rough()) > 0.6
    assert off(found) < 0.1


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_slices_lie_along_any_axis(axis):
    image, mask = (np.moveaxis(volume, 2, axis) for volume in (scan(), rough()))
    found = np.moveaxis(refine_border(image, mask, axis), axis, 2)
    assert np.array_equal(found, refine_border(scan(), rough(), 2))


def test_where_the_image_shows_nothing_the_mask_stays():
    mask = rough()
    found = refine_border(scan(50, 50), mask, 2) >= 0.5
    assert dice(found, mask) == 1
    flat = np.full(mask.shape, 7, np.float32)
    assert np.array_equal(refine_border(flat, mask, 2) >= 0.5, mask)


def test_an_edge_that_is_further_away_is_another_organ_s():
    mask = stack(np.hypot(I_, J_) < RADIUS - 6)
    found = refine_border(scan(), mask, 2) >= 0.5
    assert dice(found, mask) == 1


def test_probabilities_are_the_evidence_where_the_image_has_none():
    given = stack(np.clip(0.5 + (RADIUS - np.hypot(I_, J_)) / 6, 0, 1).astype(np.float32))
    assert np.allclose(refine_border(np.zeros(given.shape, np.float32), given, 2), given)


@pytest.fixture
def folder(tmp_path):
    write_nifti(tmp_path / "image.nii", scan(), affine_of((1, 1, 3)))
    write_nifti(tmp_path / "mask.nii", rough().astype(np.uint8), affine_of((1, 1, 3)))
    return tmp_path


def test_a_row_asks_for_it(folder):
    files = row(image="image.nii", mask="mask.nii")
    given = load_structure(files, folder, settings())
    assert given.probability is None
    moved = load_structure({**files, "border": "image"}, folder, settings())
    assert np.array_equal(moved.mask, moved.probability >= 0.5)
    frame = np.zeros(moved.frame.shape, bool)
    frame[:] = stack(TRUE)
    truth = crop(frame, moved.origin, moved.origin + moved.mask.shape - 1)
    beyond = ~crop(np.ones(frame.shape, bool), moved.origin, moved.origin + moved.mask.shape - 1)
    truth &= ~beyond
    assert dice(moved.mask & ~beyond, truth) > 0.997
    assert beyond.any()
    assert not moved.probability[beyond].any()


def test_slices_that_nobody_annotated_are_not_moved(folder):
    mask = rough().astype(np.uint8)
    mask[:, :, [2, 3]] = 0
    write_nifti(folder / "mask.nii", mask, affine_of((1, 1, 3)))
    files = row(image="image.nii", mask="mask.nii", border="image", annotated="nonempty")
    with pytest.raises(InputError, match="border: image needs a mask of every slice"):
        load_structure(files, folder, settings())
