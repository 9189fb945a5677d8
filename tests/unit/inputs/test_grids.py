"""Axis orders, oblique and left-handed grids: shapes stay where they are in the world."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from support.scans import affine_of, load, write_itk, write_nifti

from cccd.inputs.grid import (
    Volume,
    crop,
    find_slice_axis,
    interpolate_on_grid,
    on_grid,
    same_grid,
)

CENTRE, RADIUS = np.array((-5.0, 30.0, 40.0)), 15.0


def ball(affine, shape):
    """Voxels whose centres lie in a ball of the world."""
    index = np.stack(np.indices(shape), -1)
    world = index @ affine[:3, :3].T + affine[:3, 3]
    return np.linalg.norm(world - CENTRE, axis=-1) < RADIUS


def around_ball(spacing, turn, mirror, shape=(40, 40, 40)):
    affine = affine_of(spacing=spacing, turn=turn, mirror=mirror)
    affine[:3, 3] = CENTRE - affine[:3, :3] @ (np.array(shape) / 2 - 0.3)
    return affine


@pytest.mark.parametrize("mirror", [False, True])
@pytest.mark.parametrize("turn", [(0, 0, 0), (25, -40, 70), (90, 0, 90)])
@pytest.mark.parametrize("spacing", [(1.0, 1.2, 3.0), (3.0, 1.0, 1.0)])
@pytest.mark.parametrize("suffix", ["nii.gz", "nrrd"])
def test_ball_stays_in_place(tmp_path, spacing, turn, mirror, suffix):
    affine = around_ball(spacing, turn, mirror)
    mask = ball(affine, (40, 40, 40)).astype(np.uint8)
    write = write_nifti if suffix == "nii.gz" else write_itk
    write(tmp_path / f"mask.{suffix}", mask, affine)
    structure = load(tmp_path, mask=f"mask.{suffix}")
    frame = structure.frame
    assert frame.slice_axis == int(np.argmax(spacing))
    stack = structure.stack("mask")
    k, i, j = np.nonzero(stack)
    origin = structure.stack_origin
    world = frame.to_world(np.column_stack([i + origin[1], j + origin[2]]).astype(float), k + origin[0])
    assert np.linalg.norm(world - CENTRE, axis=1).max() < RADIUS + 1e-3
    np.testing.assert_allclose(world.mean(axis=0), CENTRE, atol=0.1)
    volume = len(world) * abs(np.linalg.det(frame.affine[:3, :3]))
    assert volume == pytest.approx(4 / 3 * np.pi * RADIUS**3, rel=0.01)


def test_slice_axis():
    assert find_slice_axis(np.diag([1, 5, 1, 1.0])) == 1
    assert find_slice_axis(np.diag([1, 1, 1, 1.0])) == 2
    sagittal = np.array([[0, 0, 1, 0], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1.0]])
    assert find_slice_axis(sagittal) == 1  # the axis that runs head-foot
    assert find_slice_axis(np.diag([1, 5, 1, 1.0]), 0) == 0


@hypothesis_settings(deadline=None)
@given(
    st.permutations(range(3)),
    st.tuples(*[st.booleans()] * 3),
    st.tuples(*[st.integers(-2, 2)] * 3),
    st.tuples(*[st.floats(-180, 180)] * 3),
)
def test_on_grid_undoes_any_reordering(order, flips, shift, turn):
    rng = np.random.default_rng(1)
    data = rng.random((5, 6, 7)) < 0.3
    padded = np.pad(data, 2)
    affine = affine_of(turn=turn)
    start = np.array(shift) + 2
    # the same mask, cut from its padded self, with axes permuted and flipped
    piece, moved = padded, affine.copy()
    moved[:3, 3] -= affine[:3, :3] @ (2, 2, 2)
    piece = piece[tuple(slice(max(s - 2, 0), None) for s in start)]
    moved[:3, 3] += moved[:3, :3] @ np.maximum(start - 2, 0)
    for axis in range(3):
        if flips[axis]:
            piece = np.flip(piece, axis)
            moved[:3, 3] += moved[:3, axis] * (piece.shape[axis] - 1)
            moved[:3, axis] *= -1
    back = on_grid(Volume(piece.transpose(order), moved[:, [*order, 3]], "x"), affine, data.shape, fill=False)
    np.testing.assert_array_equal(back.data, data)


def test_on_grid_refuses_what_takes_interpolation_or_cuts():
    data = np.ones((4, 4, 4), bool)
    affine = affine_of()
    half = affine.copy()
    half[:3, 3] += affine[:3, 0] * 0.5
    assert on_grid(Volume(data, half, "x"), affine, (4, 4, 4), fill=False) is None
    assert on_grid(Volume(data, affine_of(turn=(5, 0, 0)), "x"), affine, (4, 4, 4), fill=False) is None
    whole = affine.copy()
    whole[:3, 3] += affine[:3, 0]
    assert on_grid(Volume(data, whole, "x"), affine, (4, 4, 4), fill=False) is None  # would cut the mask
    assert on_grid(Volume(data, whole, "x"), affine, (4, 4, 4)) is None  # does not cover the grid


def test_resample_is_exact_for_linear_fields():
    source, target = affine_of(turn=(10, 20, 30)), affine_of(spacing=(1, 1, 1), turn=(10, 20, 30))
    index = np.stack(np.indices((10, 10, 10)), -1)
    field = (index @ source[:3, :3].T + source[:3, 3]) @ (1.0, -2.0, 0.5)
    moved = interpolate_on_grid(Volume(field, source, "x"), target, (8, 8, 8), order=1)
    expected = (np.stack(np.indices((8, 8, 8)), -1) @ target[:3, :3].T + target[:3, 3]) @ (1.0, -2.0, 0.5)
    np.testing.assert_allclose(moved.data, expected, atol=1e-9)


def test_same_grid_looks_at_far_corners():
    affine = affine_of()
    stretched = affine.copy()
    stretched[:3, 0] *= 1.001
    assert same_grid(affine, stretched, (10, 10, 10))
    assert not same_grid(affine, stretched, (500, 10, 10))


@hypothesis_settings(deadline=None)
@given(st.tuples(*[st.integers(-3, 6)] * 3), st.tuples(*[st.integers(0, 8)] * 3))
def test_crop_is_padding_and_cutting(first, size):
    array = np.arange(5 * 6 * 7).reshape(5, 6, 7) + 1
    first = np.minimum(first, (4, 5, 6))
    last = np.maximum(first + size, 0)
    part = crop(array > 0, first, last)
    assert part.shape == tuple(last - first + 1)
    index = np.stack(np.indices(part.shape), -1) + first
    expected = ((index >= 0) & (index < array.shape)).all(axis=-1)
    np.testing.assert_array_equal(part, expected)
    np.testing.assert_array_equal(crop(array, first, last)[expected], array[tuple(index[expected].T)])
