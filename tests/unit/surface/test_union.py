import numpy as np
import pytest
from skimage.measure import marching_cubes

from cccd.geometry.mesh import Mesh
from cccd.surface.booleans import Nesting, unite
from cccd.surface.union import unite_on_grid


def ball(centre, radius):
    axes = np.indices((41, 41, 41)) - 20.0
    vertices, faces, _, _ = marching_cubes(np.linalg.norm(axes, axis=0) - 15.0, 0.0)
    unit = (vertices - 20) / np.linalg.norm(vertices - 20, axis=1, keepdims=True)
    return Mesh(np.asarray(centre) + radius * unit, faces.astype(np.int64)).outwards()


OUTLINE, HOLE, ISLAND = Nesting(0, False), Nesting(1, True), Nesting(2, False)


def lens(radius, apart):
    """Volume that two balls have in common."""
    return np.pi * (4 * radius + apart) * (2 * radius - apart) ** 2 / 12


def test_two_balls_that_overlap_have_the_volume_of_their_union_and_meet_in_a_circle():
    grid, seams = unite_on_grid([ball((0, 0, 0), 10), ball((12, 0, 0), 10)], [OUTLINE, OUTLINE], 0.6)
    mesh = grid.isosurface(0.0)
    assert mesh.is_closed_manifold
    assert mesh.volume == pytest.approx(2 * 4 / 3 * np.pi * 1000 - lens(10, 12), rel=0.01)
    assert np.abs(seams[:, 0] - 6).max() < 1.3
    assert np.hypot(seams[:, 1], seams[:, 2]) == pytest.approx(8, abs=1.3)
    angles = np.sort(np.arctan2(seams[:, 2], seams[:, 1]))
    assert np.diff(angles, append=angles[0] + 2 * np.pi).max() < 0.3  # no gap along the circle


def test_holes_are_taken_away_and_islands_in_them_added():
    meshes = [ball((0, 0, 0), radius) for radius in (4, 18, 10)]
    grid, seams = unite_on_grid(meshes, [ISLAND, OUTLINE, HOLE], 0.7)
    mesh = grid.isosurface(0.0)
    assert mesh.volume == pytest.approx(4 / 3 * np.pi * (18**3 - 10**3 + 4**3), rel=0.01)
    assert len(seams) == 0


def test_a_grid_holds_what_booleans_of_the_meshes_hold():
    rng = np.random.default_rng(3)
    meshes = [ball(rng.uniform(-8, 8, 3), rng.uniform(5, 9)) for _ in range(6)]
    tubes = [OUTLINE, OUTLINE, OUTLINE, OUTLINE, HOLE, HOLE]
    grid, _ = unite_on_grid(meshes, tubes, 0.4)
    assert grid.isosurface(0.0).volume == pytest.approx(unite(meshes, tubes).volume, rel=0.01)


def test_a_hole_that_leaves_the_outline_is_cut_off_at_it():
    grid, _ = unite_on_grid([ball((0, 0, 0), 8), ball((30, 0, 0), 5)], [OUTLINE, HOLE], 0.5)
    assert grid.isosurface(0.0).volume == pytest.approx(4 / 3 * np.pi * 8**3, rel=0.01)
