import dataclasses

import numpy as np
import pytest
from patches import cylinder, random_parameters

from cccd.surface.offset import offset_patch
from cccd.surface.tessellation import tessellate


@pytest.mark.parametrize("edge", [0.7, 2.0, 6.0])
def test_meshes_of_any_density_are_closed(edge):
    mesh = tessellate(cylinder(), edge)
    assert mesh.is_closed_manifold
    assert mesh.volume == pytest.approx(np.pi * 100 * 30, rel=0.01 + 0.01 * edge**2)


def test_denser_meshes_have_more_triangles():
    coarse, fine = (len(tessellate(cylinder(), edge).faces) for edge in (2.0, 1.0))
    assert fine > 3 * coarse


@pytest.mark.parametrize("mirror", [1.0, -1.0])
def test_the_offset_surface_has_its_wall_further_out(mirror):
    patch = cylinder()
    patch = dataclasses.replace(patch, control_points=patch.control_points * [mirror, 1, 1])
    wider = offset_patch(patch, 0.5, np.array([0, 0, 1.0]))
    points = wider.evaluate(*random_parameters(patch))
    assert np.hypot(points[:, 0], points[:, 1]) == pytest.approx(10.5, abs=0.02)
    assert wider.control_points[..., 2] == pytest.approx(patch.control_points[..., 2])
