"""What a surface is measured against, how well two agree, and when one draws a warning."""

import numpy as np
import pytest
import trimesh
from support.solids import sphere

from cccd.containers import Curves, Frame, Structure
from cccd.geometry.grid import ScalarGrid
from cccd.geometry.mesh import Mesh
from cccd.geometry.raster import dice
from cccd_workflow.surface_measures import (
    bending_per_area,
    measure_mesh,
    normal_angles,
    volume_warnings,
)


def drawn_box(depth: int) -> Structure:
    """Contours of a box of 10 x 20 pixels with a hole of 4 x 4, on ``depth`` slices of 1 x 1 x 3 mm."""
    outer = np.array([(0, 0), (10, 0), (10, 20), (0, 20)], float)
    hole = np.array([(3, 3), (3, 7), (7, 7), (7, 3)], float)
    points = np.concatenate([outer, hole] * depth)
    slices = np.repeat(np.arange(depth), 2).astype(np.int32)
    frame = Frame(np.diag([1.0, 1.0, 3.0, 1.0]), 2, (12, 22, depth))
    offsets = 4 * np.arange(2 * depth + 1)
    curves = Curves(points, offsets, slices, np.tile([False, True], depth), frame)
    return Structure("a", "box", frame, np.zeros(3, int), contours=curves)


@pytest.mark.parametrize(
    ("share", "word"), [(1.0, None), (1.04, None), (0.94, "6% below"), (1.1, "10% above")]
)
def test_a_surface_that_lost_a_part_draws_a_warning(share, word):
    drawn = (10 * 20 - 4 * 4) * 3 * 5
    box = trimesh.creation.box((drawn * share / 100, 10, 10))
    figures = measure_mesh(Mesh(np.asarray(box.vertices), np.asarray(box.faces)), drawn_box(5))
    assert figures["volume_bias"] == pytest.approx(share - 1)
    warnings = volume_warnings(figures)
    assert len(warnings) == (word is not None)
    assert word is None or word in warnings[0]


def ball(step):
    axis = np.arange(-12, 12 + step / 2, step)
    distance = np.linalg.norm(np.meshgrid(axis, axis, axis, indexing="ij"), axis=0) - 10
    return ScalarGrid.uniform(distance, (-12, -12, -12), step).isosurface(0.0)


def test_normals_of_a_finer_ball_agree_and_those_of_a_tilted_plane_are_off_by_its_tilt():
    assert np.median(normal_angles(ball(0.5), ball(1.0), np.random.default_rng(0))) < 2
    square = np.array([(-1.0, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)])
    faces = np.array([(0, 1, 2), (0, 2, 3)])
    tilt = np.radians(12)
    turned = square @ np.array([(1, 0, 0), (0, np.cos(tilt), np.sin(tilt)), (0, -np.sin(tilt), np.cos(tilt))])
    angles = normal_angles(Mesh(turned, faces), Mesh(square, faces), np.random.default_rng(0))
    assert angles == pytest.approx(12.0)


def test_equal_meshes_have_equal_normals():
    angles = normal_angles(ball(1.0), ball(1.0), np.random.default_rng(0), is_smooth=False)
    assert angles.max() < 1e-3


def test_a_sphere_bends_by_twice_its_curvature_squared():
    # k1 = k2 = 1 / R: the integrand is 2 / R^2 everywhere; 3.2 % more, as triangles are not alike
    assert bending_per_area(sphere(10)) == pytest.approx(2 / 100, rel=0.035)


def test_two_empty_regions_agree():
    nothing = np.zeros((2, 2), bool)
    assert dice(nothing, nothing) == 1
    with pytest.raises(ValueError, match="differ in shape"):
        dice(nothing, np.zeros((2, 3), bool))
