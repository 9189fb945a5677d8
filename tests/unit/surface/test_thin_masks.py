"""The thin masks are as thin as they say."""

import numpy as np
import pytest
from scipy import ndimage
from thin_masks import ILIAC_WING, THIN_MASKS, endplates, iliac_wing, ribs, shell, spine

ANY = np.ones((3, 3, 3))


def runs(mask, axis):
    """Lengths of all runs of voxels along an axis."""
    lines = np.pad(np.moveaxis(mask, axis, -1).reshape(-1, mask.shape[axis]), ((0, 0), (1, 1))).astype(int)
    change = np.diff(lines, axis=1)
    return np.argwhere(change == -1)[:, 1] - np.argwhere(change == 1)[:, 1]


@pytest.mark.parametrize("name", THIN_MASKS)
def test_masks_are_apart_from_the_array_s_faces(name):
    if (made := THIN_MASKS[name]()) is None:
        pytest.skip(f"{ILIAC_WING} is not there")
    mask, affine = made
    assert mask.dtype == bool
    assert mask.any()
    assert abs(np.linalg.det(affine)) > 0
    assert not any(mask.take(end, axis).any() for axis in range(3) for end in (0, 1, 2, -1, -2, -3))


def test_endplates_are_ten_sheets_of_one_voxel():
    mask, _ = endplates()
    assert ndimage.label(mask, ANY)[1] == 10
    assert set(runs(mask, 1)) == {1}
    assert not ndimage.binary_erosion(mask, np.ones((2, 2, 1))).any()  # on no slice two pixels thick


def test_a_spine_has_bodies_and_sheets_between_them():
    mask, affine = spine()
    plates, same = endplates()
    assert np.array_equal(affine, same)
    assert (mask & plates).sum() == plates.sum()
    assert ndimage.label(mask & ~plates, ANY)[1] == 5
    assert ndimage.label(mask, ANY)[1] == 15  # no sheet touches a body


def test_a_shell_is_closed_and_one_voxel_thick():
    mask, _ = shell()
    assert ndimage.label(~mask)[1] == 2  # its inside is shut off from its outside
    middle = np.array(mask.shape) // 2
    assert all(runs(mask[middle[0]][None, [middle[1]]], 2) == 1)
    away = np.linalg.norm(np.argwhere(mask) - (np.array(mask.shape) - 1) / 2, axis=1)
    assert np.ptp(away) <= 1


@pytest.mark.parametrize(("thick", "slices"), [(1, 1.0), (2, 1.0), (2, 3.0)])
def test_ribs_are_six_thin_bars(thick, slices):
    mask, affine = ribs(thick, slices)
    assert ndimage.label(mask, ANY)[1] == 6
    assert affine[2, 2] == slices
    assert not ndimage.binary_erosion(mask, np.ones((thick + 2,) * 3)).any()


def test_the_iliac_wing_is_the_scan_s():
    if not ILIAC_WING.exists():
        pytest.skip(f"{ILIAC_WING} is not there")
    mask, affine = iliac_wing()
    assert mask.sum() == 13_166
    assert np.allclose(np.linalg.norm(affine[:3, :3], axis=0), 3)
    assert iliac_wing(ILIAC_WING.with_name("absent.nii.gz")) is None
