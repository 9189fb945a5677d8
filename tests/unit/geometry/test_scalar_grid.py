import numpy as np
import pytest

from cccd.geometry.grid import ScalarGrid


@pytest.mark.parametrize("mirror", [1.0, -1.0])
def test_isosurface_of_a_distance_is_a_sphere_that_faces_outwards(mirror):
    affine = np.array([[mirror * 0.5, 0, 0, 3], [0, 0.7, 0, -4], [0, 0, 0.6, 5], [0, 0, 0, 1.0]])
    index = np.argwhere(np.ones((60, 50, 55)))
    centre = affine[:3, :3] @ (30, 25, 27) + affine[:3, 3]
    distance = np.linalg.norm(index @ affine[:3, :3].T + affine[:3, 3] - centre, axis=1) - 9.0
    grid = ScalarGrid(distance.reshape(60, 50, 55), affine)
    for level in (0.0, 2.5, -4.0):
        mesh = grid.isosurface(level)
        assert mesh.is_closed_manifold
        assert mesh.volume == pytest.approx(4 / 3 * np.pi * (9 + level) ** 3, rel=0.02)
        assert np.linalg.norm(mesh.vertices - centre, axis=1) == pytest.approx(9 + level, abs=0.03)


def test_a_block_of_a_larger_grid_lies_where_it_was():
    values = np.random.default_rng(0).normal(size=(9, 8, 7))
    affine = np.array([[0.5, 0.1, 0, 3], [0, 0.7, 0, -4], [0.2, 0, 0.6, 5], [0, 0, 0, 1.0]])
    block = ScalarGrid(values[2:, 3:, 1:], affine, (2, 3, 1)).isosurface(0.0)
    whole = ScalarGrid(values, affine).isosurface(0.0)
    away = np.linalg.norm(block.vertices[:, None] - whole.vertices, axis=2).min(axis=1)
    assert away.max() < 1e-5


@pytest.mark.parametrize("share", [0.1, 0.3, 0.5])
def test_a_random_mask_with_every_ambiguous_cube_has_a_closed_surface(share):
    mask = np.pad(np.random.default_rng(0).random((24, 24, 24)) < share, 1)
    mesh = ScalarGrid(mask.astype(np.float32), np.eye(4)).isosurface(0.5)
    assert mesh.is_closed_manifold


def test_a_level_that_nothing_reaches_is_refused():
    with pytest.raises(ValueError, match="level"):
        ScalarGrid(np.zeros((4, 4, 4)), np.eye(4)).isosurface(1.0)
