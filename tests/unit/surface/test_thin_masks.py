"""Nothing that a slice shows is lost, however thin: every voxel's centre is on its side of the surface."""

import numpy as np
import pytest
from support.thin_masks import endplates, iliac_wing, ribs, shell
from truth_measures import wrong_voxels

import cccd


def left_ribs(thick, slices):
    """Half of the chest; the other is its mirror image."""
    mask, affine = ribs(thick, slices)
    return mask[: len(mask) // 2], affine


MASKS = {
    "shell": shell,
    "ribs of one voxel": lambda: left_ribs(1, 1.0),
    "ribs of two voxels": lambda: left_ribs(2, 1.0),
    "ribs of two voxels, thick slices": lambda: left_ribs(2, 3.0),
    "iliac wing": iliac_wing,
}


@pytest.mark.parametrize("name", MASKS)
def test_no_voxel_of_a_thin_mask_is_lost(name):
    made = MASKS[name]()
    if made is None:
        pytest.skip("no ../shared/data/liver_totalseg_ct3mm")
    mask, affine = made
    surface = cccd.reconstruct(mask, affine)
    assert surface.lofted.mesh.is_closed_manifold
    assert len(surface.lofted.mesh.self_intersections()) == 0
    count, farthest = wrong_voxels(surface.lofted.mesh, mask, affine)
    assert count == 0
    assert farthest <= 0.75
    assert surface.volume == pytest.approx(mask.sum() * np.linalg.det(affine[:3, :3]), rel=0.005)


@pytest.mark.parametrize(("wide", "aside"), [(1, 0), (1, 1), (2, 1), (2, 2)])
def test_a_vessel_of_one_pixel_through_thick_slices_stays(wide, aside):
    i, j, k = np.indices((40, 40, 14))
    mask = np.hypot(np.hypot(i - 19.5, j - 19.5), 3 * (k - 6.5)) <= 17
    for n in range(3, 11):
        mask[12 + aside * (n - 3) :, 20, n][:wide] = False
    affine = np.diag([1.0, 1, 3, 1])
    assert wrong_voxels(cccd.reconstruct(mask, affine).lofted.mesh, mask, affine)[0] == 0


def test_cavities_that_are_filled_are_said():
    mask = np.linalg.norm(np.indices((24, 24, 24)) - 11.5, axis=0) <= 9
    mask[12, 12, 12] = False
    assert any("filled 1 cavity" in line for line in cccd.reconstruct(mask).warnings)


def test_endplates_of_one_voxel_are_sheets():
    """No slice has a curve through the centres of their pixels."""
    mask, affine = endplates()
    bottom = np.flatnonzero(mask.any(axis=(0, 2)))[0]
    front = np.flatnonzero(mask.any(axis=(1, 2)))[0]
    mask = mask[front - 4 : 4 - front, bottom - 4 : bottom + 28, : mask.shape[2] // 2]
    mask[:, -4:] = False
    affine = affine.copy()
    affine[:3, 3] += affine[:3, :2] @ (front - 4, bottom - 4)
    count, _ = wrong_voxels(cccd.reconstruct(mask, affine).lofted.mesh, mask, affine)
    assert count == 0
