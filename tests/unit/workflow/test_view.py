"""Meshes of the page against spheres, of which everything is known."""

import numpy as np
import pytest
from support.solids import sphere

from cccd.containers import Frame, Structure
from cccd_workflow.view import reference_surface


@pytest.mark.parametrize("radius", [5.0, 40.0])
def test_mean_curvature_of_a_sphere_is_one_over_its_radius(radius):
    mesh = sphere(radius, subdivisions=5)
    np.testing.assert_allclose(mesh.mean_curvature(mesh.vertices[::50]), 1 / radius, rtol=1e-3)


def test_reference_is_the_truth_where_there_is_one():
    frame = Frame(np.eye(4), 2, (9, 9, 9))
    mask = np.zeros((9, 9, 9), bool)
    mask[2:7, 2:7, 2:7] = True
    voxels, name = reference_surface(Structure("a", "b", frame, np.zeros(3, int), mask=mask))
    assert "mask" in name
    # half a voxel is cut off along 12 edges, and another pyramid at 8 corners
    assert voxels.volume == pytest.approx(5**3 - 12 * 4 / 8 - 8 * (1 / 8 - 1 / 48))
    truth = sphere(3.0, subdivisions=2)
    known = Structure("a", "b", frame, np.zeros(3, int), mask=mask, truth=truth)
    assert reference_surface(known)[1] == "the analytic surface"
    assert reference_surface(Structure("a", "b", frame, np.zeros(3, int))) is None
