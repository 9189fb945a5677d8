"""Walls of fewer triangles: as many as curvature needs, the same topology, the same lines between walls."""

import numpy as np
import pytest

from cccd.geometry.mesh import Mesh
from cccd_labels.surface_nets import surface_nets, well_composed
from cccd_labels.wall_decimation import simplified


@pytest.fixture(scope="module")
def halves():
    """Two half balls of a radius of 20 on a net whose vertices lie on the truth."""
    centre = np.array([24.3, 24.1, 24.2])
    place = np.indices((49, 49, 49)) - centre.reshape(3, 1, 1, 1)
    radius = np.linalg.norm(place, axis=0)
    labels = np.where(radius < 20, np.where(place[0] < 0, 1, 2), 0).astype(np.int32)
    net = surface_nets(labels, lambda nodes, ends, low, high: np.full(len(nodes), 0.5))
    outward = net.vertices - centre
    within = net.regions.min(axis=1) > 0
    outward[np.unique(net.triangles[within]), 0] = 0
    outer = np.isin(np.arange(len(outward)), net.triangles[~within])
    away = np.linalg.norm(outward, axis=1, keepdims=True)
    outward = np.where(outer[:, None], 20 * outward / away, outward)
    return type(net)(outward, net.triangles, net.regions)


@pytest.mark.parametrize("tolerance", [0.02, 0.05, 0.2])
def test_what_is_left_lies_on_the_walls(halves, tolerance):
    fewer = simplified(halves, tolerance)
    outer = Mesh(fewer.vertices, fewer.triangles[fewer.regions[:, 1] == 0])
    off = np.linalg.norm(outer.sample(5000, np.random.default_rng(0)), axis=1) - 20
    assert np.abs(off).mean() < tolerance
    wall = fewer.vertices[np.unique(fewer.triangles[fewer.regions.min(axis=1) > 0])]
    assert np.abs(wall[:, 0]).max() < 1e-6
    for mesh in map(fewer.mesh_of, (1, 2)):
        assert (mesh.is_closed_manifold, mesh.genus) == (True, 0)


def test_a_plane_needs_least_and_lines_keep_their_vertices(halves):
    fewer = simplified(halves, 0.05)
    flat, bent = ((surface.regions.min(axis=1) > 0) for surface in (fewer, halves))
    assert flat.sum() < 0.35 * bent.sum()
    assert len(fewer.triangles) < 0.4 * len(halves.triangles)
    lines = [{point.tobytes() for point in one.vertices[one.junctions.ravel()]} for one in (fewer, halves)]
    assert lines[0] == lines[1]


def test_where_a_wall_would_tear_only_what_is_beside_keeps_more():
    place = np.indices((49,) * 3) - 24.2
    bars = (place[:2] % 10 < 3).any(axis=0) & (place[2] % 10 < 3) & (np.linalg.norm(place, axis=0) < 21)
    labels = well_composed(bars.astype(np.int32), lambda nodes, labels: labels.astype(float))[0]
    net = surface_nets(labels, lambda nodes, *ends: np.full(len(nodes), 0.5))
    fewer = simplified(net, 0.1)
    assert len(fewer.triangles) < 0.2 * len(net.triangles)
    assert fewer.mesh_of(1).is_closed_manifold
