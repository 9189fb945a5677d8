"""A head around a brain: what lies on the way out, and that the brain stays as it is."""

import numpy as np
import pytest

from cccd.inputs.grid import Volume
from cccd_datasets.heads import draw_head

TOP = 40


@pytest.fixture(scope="module")
def brain():
    """A ball of 40 mm around the origin of the MNI space, white but for a grey rim."""
    affine = np.eye(4)
    affine[:3, 3] = (-78, -90, -70)
    places = np.indices((156, 175, 150), np.float32) + affine[:3, 3].reshape(3, 1, 1, 1)
    away = np.sqrt((places**2).sum(axis=0))
    inside = away < TOP
    image = np.where(inside, np.where(away < TOP - 5, 0.8, 0.6), 0).astype(np.float32)
    return Volume(image, affine, "x"), Volume(inside, affine, "x")


@pytest.fixture(scope="module")
def heads(brain):
    """Two of one seed, and one of another."""
    return [draw_head(*brain, np.random.default_rng(seed)).data for seed in (1, 1, 2)]


def test_the_brain_keeps_its_contrast_and_the_head_is_drawn_by_the_seed(brain, heads):
    (image, inside), (once, again, other) = brain, heads
    np.testing.assert_array_equal(once, again)
    assert (once != other).any()
    np.testing.assert_allclose(once[inside.data], image.data[inside.data] / 0.8, rtol=1e-6)


def test_on_the_way_up_come_fluid_bone_marrow_bone_fat_and_air(heads):
    way = heads[0][78, 80, 70 + TOP :]  # beside the sinus in the midline
    air = np.flatnonzero(way == 0)[0]
    assert 8 < air < 25  # mm of skull and scalp
    assert (way[air : air + 10] == 0).all()
    bone = np.flatnonzero(way[:air] < 0.3)
    fat = np.flatnonzero(way[:air] > 0.8)
    assert bone.min() < fat.max()
    assert fat.max() > air - 7
    assert way[:air][bone].min() < 0.2  # darker than the fluid


def test_no_single_threshold_separates_brain_from_head(brain, heads):
    inside, head = brain[1], heads[2]
    grey = head[inside.data]
    alike = (head >= grey.min()) & (head <= grey.max()) & ~inside.data
    assert alike.sum() > 0.3 * inside.data.sum()
