import sys

import numpy as np
import pytest
from support.solids import box, sphere

from cccd.geometry.distance import (
    nearest_faces,
    nearest_points,
    to_mask,
    to_mesh,
    to_polygons,
    unsigned_to_mesh,
)
from cccd.geometry.mesh import Mesh
from cccd.geometry.polygons import RaggedPolygons
from cccd.geometry.thickness import Lines


def disc(radius, spacing, shape=(61, 61)):
    i, j = np.meshgrid(*map(np.arange, shape), indexing="ij")
    centre = (np.array(shape) - 1) / 2
    return np.hypot((i - centre[0]) * spacing[0], (j - centre[1]) * spacing[1]) - radius


@pytest.mark.parametrize("spacing", [(1.0, 1.0), (0.5, 0.5), (0.7, 1.3)])
def test_distance_to_the_mask_of_a_disc(spacing):
    exact = disc(18.0 * min(spacing), spacing)
    measured = to_mask(exact < 0, np.array(spacing))
    assert measured.dtype == np.float32
    assert np.array_equal(measured < 0, exact < 0)
    assert np.abs(measured - exact).max() < 0.75 * max(spacing)


@pytest.mark.parametrize("spacing", [(1.0, 1.0), (0.7, 1.3)])
def test_distance_to_a_drawn_disc_is_exact_near_it_and_nearly_so_far_away(spacing):
    exact = disc(17.3, spacing)
    angle = np.arange(4000) * 2 * np.pi / 4000
    circle = RaggedPolygons.of(
        [17.3 * np.column_stack([np.cos(angle), np.sin(angle)]) + 30 * np.array(spacing)]
    )
    measured = to_polygons(exact < 0, circle, np.array(spacing))
    near = np.abs(exact) < 2 * min(spacing)
    assert measured[near] == pytest.approx(exact[near], abs=1e-4)
    assert measured == pytest.approx(exact, abs=0.1 * max(spacing))


def test_distance_is_positive_outside_and_negative_inside():
    offsets = np.array([-3.0, -0.5, 0.5, 8.0])
    points = np.array([0.48, 0.6, 0.64]) * (20 + offsets)[:, None]
    ball = sphere(20.0, subdivisions=5)
    np.testing.assert_allclose(to_mesh(points, ball), offsets, atol=0.05)
    np.testing.assert_allclose(unsigned_to_mesh(points, ball), np.abs(offsets), atol=0.05)


def test_distances_need_no_pyvista(monkeypatch):
    monkeypatch.setitem(sys.modules, "pyvista", None)  # as where only `pip install .` was typed
    distance = unsigned_to_mesh(np.array([[0.0, 0.0, 7.0], [0.0, 0.0, 1.0]]), box((4.0, 6.0, 5.0)))
    np.testing.assert_allclose(distance, [4.5, 1.5], atol=1e-6)


def test_the_nearest_face_of_a_point_above_a_face_is_that_face(monkeypatch):
    monkeypatch.setitem(sys.modules, "pyvista", None)
    ball = sphere(20.0)
    above = ball.vertices[ball.faces].mean(axis=1) + 0.1 * ball.unit_normals
    assert np.array_equal(nearest_faces(above, ball), np.arange(len(ball.faces)))


def test_distances_to_a_mesh_are_those_of_vtk_signs_included():
    filters = pytest.importorskip("vtkmodules.vtkFiltersCore")
    rng = np.random.default_rng(0)
    plate, ball = box((4.0, 6.0, 0.5)), sphere(3.0)
    mesh = Mesh.joined([plate, Mesh(ball.vertices + np.array((0, 0, 5)), ball.faces)])
    points = np.concatenate([rng.uniform(-9, 9, (2000, 3)), 1.2 * mesh.vertices, 0.9 * plate.vertices])
    theirs = filters.vtkImplicitPolyDataDistance()
    theirs.SetInput(mesh.to_vtk())
    distance = [theirs.FunctionValue(point) for point in points]
    np.testing.assert_allclose(to_mesh(points, mesh), distance, atol=1e-12)
    off = np.linalg.norm(points - nearest_points(points, mesh), axis=1)
    np.testing.assert_allclose(off, np.abs(distance), atol=1e-12)


def test_lines_meet_a_box_where_they_enter_or_leave_it():
    starts = np.array([(-10, 0.3, 0.2), (0.1, 0.3, 0.2), (-10, 0.3, 0.2), (-10, 9.0, 0.0)])
    ends = np.array([(10, 0.3, 0.2), (0.1, 10.3, 0.2), (-3, 0.3, 0.2), (10, 9.0, 0.0)])
    np.testing.assert_allclose(Lines(box((4.0, 6.0, 5.0))).first_hits(starts, ends), [0.4, 0.27, 1, 1])
