"""Quad layouts and the bicubic patches on them, without OpenCASCADE."""

from dataclasses import replace

import numpy as np
import pytest
from closed_shapes import mesh_of, ring, sphere

from cccd.solids.decimation import collapse_edges
from cccd.solids.layout import Footpoints, grid_ids, lay_quads
from cccd.solids.patches import creased, fit_patches, patches_within
from cccd.solids.shells import measure_deviation

ROUNDS = 12


@pytest.fixture(scope="module")
def ball():
    return patches_within(sphere(10.0), 0.05, 60, 2000, ROUNDS)


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


def test_twice_the_patches_where_the_tolerance_asks():
    coarse, fine = (patches_within(ring(), tolerance, 60, 2000, ROUNDS) for tolerance in (1.0, 0.03))
    assert len(fine.quads) > len(coarse.quads)
    assert fine.mesh.genus == coarse.mesh.genus == 1
    assert measure_deviation(fine.mesh, ring()).p99 <= 0.03


def test_none_where_the_tolerance_is_out_of_reach():
    assert patches_within(ring(), 1e-5, 60, 60, ROUNDS) is None


def test_samples_stay_on_their_side_of_a_thin_plate():
    plate = mesh_of_plate()
    layout = lay_quads(collapse_edges(plate, 100, 1e-2), Footpoints(plate), 3)
    upper = layout.points[:, 2] > 0
    height = np.abs(layout.points[:, 2])
    assert np.median(height) == pytest.approx(0.2, abs=1e-6)
    assert 0.3 < upper.mean() < 0.7
    assert fit_patches(layout).mesh.volume == pytest.approx(plate.volume, rel=0.05)


def mesh_of_plate():
    import trimesh

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
