"""Meshes of the page against spheres, of which everything is known."""

import numpy as np
import pytest
import trimesh

from cccd.containers import Frame, Structure
from cccd.geometry.mesh import Mesh
from cccd_workflow.view import reference_surface, voxel_surface


def sphere(radius, subdivisions=5):
    mesh = trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius)
    return Mesh(np.array(mesh.vertices), np.array(mesh.faces, np.int64))


def volume(mesh):
    return trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).volume


@pytest.mark.parametrize("radius", [5.0, 40.0])
def test_mean_curvature_of_a_sphere_is_one_over_its_radius(radius):
    mesh = sphere(radius)
    np.testing.assert_allclose(mesh.mean_curvature(mesh.vertices[::50]), 1 / radius, rtol=1e-3)


def test_reference_is_the_truth_where_there_is_one():
    frame = Frame(np.eye(4), 2, (9, 9, 9))
    mask = np.zeros((9, 9, 9), bool)
    mask[2:7, 2:7, 2:7] = True
    voxels = voxel_surface(Structure("a", "b", frame, np.zeros(3, int), mask=mask))
    # half a voxel is cut off along 12 edges, and another pyramid at 8 corners
    assert volume(voxels) == pytest.approx(5**3 - 12 * 4 / 8 - 8 * (1 / 8 - 1 / 48))
    truth = sphere(3.0, 2)
    known = Structure("a", "b", frame, np.zeros(3, int), mask=mask, truth=truth)
    assert reference_surface(known, voxels)[1] == "the analytic surface"
    nothing = Structure("a", "b", frame, np.zeros(3, int))
    assert reference_surface(nothing, voxel_surface(nothing)) is None
