"""Splines fitted to closed meshes: near, closed, of the same topology, with few quads."""

import numpy as np
import pytest
import trimesh
from support.closed_shapes import mesh_of, ring

from cccd_solids.fitted import fit_within
from cccd_solids.shells import measure_deviation


def test_finer_where_the_tolerance_asks():
    coarse, fine = (fit_within(ring(), tolerance, 4000) for tolerance in (1.0, 0.02))
    assert len(coarse.quads) < len(fine.quads) < 4000
    for spline, tolerance in ((coarse, 1.0), (fine, 0.02)):
        drawn = spline.tessellate(2)
        assert drawn.is_closed_manifold
        assert drawn.genus == 1
        assert measure_deviation(drawn, ring()).p99 <= tolerance
        assert drawn.volume == pytest.approx(ring().volume, rel=5e-3)


def test_a_mesh_of_few_triangles_is_followed_between_its_vertices():
    """Half a ball: a flat wall, as between neighbours, that meets a round one at a sharp edge."""
    ball = trimesh.creation.icosphere(2, 10.0)
    half = mesh_of(trimesh.intersections.slice_mesh_plane(ball, (0, 0, 1), (0, 0, 0.1), cap=True))
    drawn = fit_within(half, 0.2, 4000).tessellate(2)
    assert measure_deviation(drawn, half).p99 <= 0.2
    near = np.hypot(*drawn.vertices[:, :2].T) < 8
    flat = np.abs(drawn.vertices[near & (drawn.vertices[:, 2] < 1), 2] - 0.1)
    assert flat.max() < 0.2


def test_a_narrow_hole_stays_one():
    narrow = mesh_of(trimesh.creation.torus(5.0, 4.9, major_sections=96, minor_sections=96))
    drawn = fit_within(narrow, 0.1, 4000).tessellate(2)
    assert drawn.genus == 1
    assert len(drawn.self_intersections()) == 0


def test_none_where_the_tolerance_is_out_of_reach():
    assert fit_within(ring(), 1e-5, 400) is None
