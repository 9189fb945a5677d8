"""Quad layouts and the bicubic patches on them, without OpenCASCADE."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from closed_shapes import mesh_of, ring, sphere

from cccd.geometry.decimation import collapse_edges
from cccd.solids.layout import Footpoints, grid_ids, lay_flat, lay_quads, with_flat
from cccd.solids.patches import creased, fit_patches, patches_within
from cccd.solids.shells import measure_deviation


@pytest.fixture(scope="module")
def ball():
    return patches_within(sphere(10.0), 0.05, 60, 2000)


def test_neighbours_share_the_points_of_their_edge():
    cube = np.array([(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)])
    ids = grid_ids(cube, 5)
    assert len(np.unique(ids)) == 8 + 12 * 3 + 6 * 9
    sides = [face[:, (0, -1)].T.tolist() + face[(0, -1), :].tolist() for face in ids]
    edges = sorted(
        tuple(side) if side[0] < side[-1] else tuple(side[::-1]) for face in sides for side in face
    )
    assert edges[::2] == edges[1::2]


def test_a_ball_is_smooth_round_and_closed(ball):
    assert ball.mesh.is_closed_manifold
    radius = np.linalg.norm(ball.samples, axis=-1)
    assert np.abs(radius - 10).max() < 0.05
    assert ball.mesh.volume == pytest.approx(4 / 3 * np.pi * 1000, rel=5e-3)
    outwards = np.einsum("qijc,qijc->qij", ball.normals(), ball.samples)
    assert outwards.min() > 0


def test_far_fewer_patches_than_facets(ball):
    facets = collapse_edges(sphere(10.0), len(ball.quads))
    near = measure_deviation(ball.mesh, sphere(10.0))
    assert near.p99 < measure_deviation(facets, sphere(10.0)).p99 / 3


def test_more_patches_where_the_tolerance_asks():
    coarse, fine = (patches_within(ring(), tolerance, 60, 2000) for tolerance in (1.0, 0.03))
    assert len(fine.quads) > len(coarse.quads)
    assert fine.mesh.genus == coarse.mesh.genus == 1
    assert measure_deviation(fine.mesh, ring()).p99 <= 0.03


def test_none_where_the_tolerance_is_out_of_reach():
    assert patches_within(ring(), 1e-5, 60, 60) is None


def test_a_narrow_hole_stays_one():
    """Triangles at the hole are smaller or flat: none folds, whatever the rest needs."""
    narrow = mesh_of(trimesh.creation.torus(5.0, 4.9, major_sections=96, minor_sections=96))
    fitted = patches_within(narrow, 0.1, 60, 4000)
    assert fitted is not None
    assert fitted.mesh.genus == 1
    assert fitted.mesh.is_closed_manifold
    assert len(fitted.mesh.self_intersections()) == 0
    assert measure_deviation(fitted.mesh, narrow).p99 <= 0.1


def test_flat_triangles_are_planes_and_leave_the_rest():
    coarse = collapse_edges(sphere(10.0), 60, 1e-2)
    layout, planar = lay_quads(coarse, Footpoints(sphere(10.0)), 3), lay_flat(coarse, 3)
    flat = np.arange(60) == 7
    fitted = fit_patches(with_flat(layout, planar, flat))
    normal = coarse.unit_normals[7]
    height = (fitted.samples[np.tile(flat, 3)] - coarse.vertices[coarse.faces[7, 0]]) @ normal
    assert height == pytest.approx(0, abs=2e-4)  # control points are rounded
    far = ~np.tile(coarse.with_neighbours(flat), 3)
    assert np.array_equal(
        fitted.control_points[fitted.nets[far]], fit_patches(layout).control_points[fitted.nets[far]]
    )
    assert fitted.mesh.is_closed_manifold
    assert len(fitted.mesh.self_intersections()) == 0


def test_samples_stay_on_their_side_of_a_thin_plate():
    plate = mesh_of_plate()
    layout = lay_quads(collapse_edges(plate, 100, 1e-2), Footpoints(plate), 3)
    upper = layout.points[:, 2] > 0
    height = np.abs(layout.points[:, 2])
    assert np.median(height) == pytest.approx(0.2, abs=1e-6)
    assert 0.3 < upper.mean() < 0.7
    assert fit_patches(layout).mesh.volume == pytest.approx(plate.volume, rel=0.05)


def mesh_of_plate():
    plate = trimesh.creation.box((20.0, 20.0, 0.4))
    for _ in range(5):
        plate = plate.subdivide()
    return mesh_of(plate)


def test_a_crease_between_the_samples_is_noticed(ball):
    assert not creased(ball.normals(33)).any()
    points = ball.control_points.copy()
    inner = ball.nets[0, 2:4, 2:4].ravel()
    middle = points[inner].mean(axis=0)
    points[inner] = middle - 3 * (points[inner] - middle)
    folded = replace(ball, control_points=points)
    found = creased(folded.normals(33))
    assert found[0]
    assert not found[1:].any()
