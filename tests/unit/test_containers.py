import numpy as np
import pytest
from support.refusals import refusal

from cccd.containers import Frame, Structure


@pytest.mark.parametrize("slice_axis", [0, 1, 2])
def test_points_land_where_the_affine_says_for_any_slice_axis(slice_axis):
    rng = np.random.default_rng(slice_axis)
    affine = np.vstack([rng.normal(size=(3, 4)), [0, 0, 0, 1]])
    frame = Frame(affine, slice_axis, (5, 6, 7))
    index = rng.uniform(0, 5, (10, 3))
    points = np.delete(index, slice_axis, axis=1)
    expected = index @ affine[:3, :3].T + affine[:3, 3]
    np.testing.assert_allclose(frame.to_world(points, index[:, slice_axis]), expected, atol=1e-12)


def test_stack_puts_slices_first_and_origin_follows():
    frame = Frame(np.diag([1.0, 2, 3, 1]), 1, (9, 9, 9))
    mask = np.zeros((3, 4, 5), bool)
    mask[1, 2, 3] = True
    structure = Structure("c", "o", frame, np.array([10, 20, 30]), mask=mask)
    (k,), (i,), (j,) = np.nonzero(structure.stack("mask"))
    np.testing.assert_array_equal(structure.stack_origin + np.array([k, i, j]), (22, 11, 33))
    assert structure.stack("image") is None
    assert "c/o: there is no image" in refusal(structure.required_stack, "image")
    assert frame.slice_spacing == 2
    assert frame.pixel_spacing.tolist() == [1, 3]
