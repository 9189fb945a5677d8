"""Meshes of the page against spheres, of which everything is known."""

import numpy as np
import pytest
import trimesh

from cccd.containers import Frame, Structure
from cccd.geometry.curvature import mean_curvature
from cccd.geometry.mesh import Mesh
from cccd.view import reference_surface, sort_spatially


def sphere(radius, subdivisions=5):
    mesh = trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius)
    return Mesh(np.array(mesh.vertices), np.array(mesh.faces, np.int64))


def volume(mesh):
    return trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).volume


@pytest.mark.parametrize("radius", [5.0, 40.0])
def test_mean_curvature_of_a_sphere_is_one_over_its_radius(radius):
    mesh = sphere(radius)
    np.testing.assert_allclose(mean_curvature(mesh, mesh.vertices[::50]), 1 / radius, rtol=1e-3)


def test_sorting_changes_the_order_and_nothing_else():
    mesh = sphere(10.0, 3)
    spare = Mesh(np.vstack([[[99.0, 99, 99]], mesh.vertices]), mesh.faces + 1)  # an unused vertex
    ordered, order = sort_spatially(spare)
    np.testing.assert_array_equal(spare.vertices[order], ordered.vertices)
    assert len(ordered.vertices) == len(mesh.vertices)
    corners = {tuple(map(tuple, face)) for face in mesh.vertices[mesh.faces]}
    assert {tuple(map(tuple, face)) for face in ordered.vertices[ordered.faces]} == corners
    first_use = np.sort(np.unique(ordered.faces.ravel(), return_index=True)[1])
    np.testing.assert_array_equal(ordered.faces.ravel()[first_use], np.arange(len(ordered.vertices)))


def test_reference_is_the_truth_where_there_is_one():
    frame = Frame(np.eye(4), 2, (9, 9, 9))
    mask = np.zeros((9, 9, 9), bool)
    mask[2:7, 2:7, 2:7] = True
    voxels, name = reference_surface(Structure("a", "b", frame, np.zeros(3, int), mask=mask))
    assert "mask" in name
    # half a voxel is cut off along 12 edges, and another pyramid at 8 corners
    assert volume(voxels) == pytest.approx(5**3 - 12 * 4 / 8 - 8 * (1 / 8 - 1 / 48))
    truth = sphere(3.0, 2)
    known = Structure("a", "b", frame, np.zeros(3, int), mask=mask, truth=truth)
    assert reference_surface(known)[1] == "the analytic surface"
    assert reference_surface(Structure("a", "b", frame, np.zeros(3, int))) is None
