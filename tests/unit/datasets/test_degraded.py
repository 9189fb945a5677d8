"""Structures that no mask gives away: what is made of them follows from no ground truth."""

import numpy as np
import pytest
from support.scans import load_structure, row, settings

from cccd.containers import Frame, Structure
from cccd.errors import InputError
from cccd.inputs.grid import Volume
from cccd.settings.junctions import BoundarySettings
from cccd_datasets.degraded import bias_field, coarser, damage_maps, rescan
from cccd_junctions.boundary import extract_boundaries, outline

AFFINE = np.array([[0.0, -2, 0, 5], [1, 0, 0, -3], [0, 0, 3, 7], [0, 0, 0, 1]])


def brain(radius=14.0):
    """A ball of grey value 1 on a grid of 1 mm, off the middle, and its mask."""
    offset = np.indices((40, 44, 40)) - np.array([19, 22, 20]).reshape(3, 1, 1, 1)
    inside = (offset**2).sum(0) < radius**2
    affine = np.eye(4)
    return Volume(inside.astype(np.float32), affine, "mni152"), Volume(inside, affine, "mni152"), {}


def test_a_coarse_voxel_is_the_mean_of_its_block_and_lies_in_its_middle():
    every = (2, 1, 3)
    fine = Volume(np.arange(5 * 2 * 6, dtype=float).reshape(5, 2, 6), AFFINE, "x")
    made = coarser(fine, every)
    assert made.shape == (2, 2, 2)
    np.testing.assert_allclose(made.data[1, 1, 1], fine.data[2:4, 1, 3:6].mean())
    middle = np.array([2.5, 1, 4, 1])
    np.testing.assert_allclose(made.affine @ [1, 1, 1, 1], AFFINE @ middle)


def test_noise_is_rician_and_the_bias_as_wide_as_asked():
    flat = Volume(np.zeros((40, 40, 40), np.float32), np.eye(4), "x")
    flat.data[20:] = 1
    image, _ = rescan(flat, flat, np.random.default_rng(2), every=(1, 1, 1), noise=0.05, bias=0.0)
    dark, bright = image.data[:20], image.data[20:]
    assert dark.mean() == pytest.approx(0.05 * np.sqrt(np.pi / 2), rel=0.02)  # Rayleigh
    assert bright.std() == pytest.approx(0.05, rel=0.02)
    field = bias_field(np.random.default_rng(3), (30, 20, 10), 0.3)
    assert (field.min(), field.max()) == pytest.approx((0.85, 1.15))
    assert max(np.abs(np.diff(field, axis=axis)).max() for axis in range(3)) < 0.1  # smooth


def test_no_ground_truth_is_in_band_window_or_crop(monkeypatch):
    """Another mask beside the same image changes what is scored, and nothing else."""
    found = []
    for radius in (14.0, 6.0):
        image, _, facts = brain()
        _, mask, _ = brain(radius)
        monkeypatch.setattr("cccd_datasets.packaged.read_mni152", lambda *_, made=(image, mask, facts): made)
        structure = load_structure(row(source="mni152_scan", organ="brain"), ".", settings(), seed=4)
        found.append((structure, extract_boundaries(structure, BoundarySettings())))
    (one, pixels), (other, same_pixels) = found
    for name in ("origin", "image", "region"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    np.testing.assert_array_equal(pixels.points, same_pixels.points)
    assert other.mask.sum() < 0.2 * one.mask.sum()
    assert 0.9 < one.region.sum() / one.mask.sum() < 1.1


@pytest.mark.parametrize(
    ("window", "words"), [((5000, None), "no region between 5000"), ((-1, None), "the whole image lies")]
)
def test_a_threshold_that_finds_nothing_or_everything_is_named(monkeypatch, window, words):
    monkeypatch.setattr("cccd_datasets.packaged.read_mni152", lambda *_: brain())
    asked = settings(region={"window": window})
    with pytest.raises(InputError, match=words) as error:
        load_structure(row(source="mni152_scan", organ="brain"), ".", asked)
    assert "import: region: window" in str(error.value)


def test_maps_without_damage_are_the_mask_s_outline_and_the_mask_is_not_looked_at_again():
    mask = np.moveaxis(brain()[1].data, 0, 1)
    whole = Structure(
        "a", "b", Frame(np.eye(4), 1, mask.shape), np.array([3, 4, 5]), image=mask * 1.0, mask=mask
    )
    made = damage_maps(whole, np.random.default_rng(0), kinds=("clean",))
    assert made.image is None
    np.testing.assert_array_equal(made.stack("boundary"), outline(made.stack("mask")))
    np.testing.assert_array_equal(
        np.argwhere(made.mask) + made.origin, np.argwhere(mask) + whole.origin
    )  # in the same place
    pixels = extract_boundaries(made, BoundarySettings()).points
    made.mask = np.zeros_like(made.mask)
    np.testing.assert_array_equal(extract_boundaries(made, BoundarySettings()).points, pixels)


def test_every_slice_has_one_of_the_kinds_and_is_drawn_from_the_seed():
    asked = settings(phantom={"spacing_mm": (1.5, 1.5, 6)})
    one, same, other = (
        load_structure(row(source="damaged_phantom", organ="sphere"), ".", asked, seed=seed)
        for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(one.boundary, same.boundary)
    assert one.boundary.shape != other.boundary.shape or (one.boundary != other.boundary).any()
    stack, truth = one.stack("boundary"), outline(one.stack("mask"))
    kinds = one.provenance["damaged"]
    for k, kind in kinds.items():
        drawn, right = (planes[int(k) - one.stack_origin[0]] for planes in (stack, truth))
        assert {"gaps": drawn <= right, "spurs": drawn >= right}.get(kind, np.True_).all()
        assert (drawn != right).any()
    assert len(kinds) == one.stack("mask").any(axis=(1, 2)).sum()
    assert len(set(kinds.values())) > 3
    assert one.truth is not None
