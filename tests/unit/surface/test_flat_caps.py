import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from cccd.geometry.grid import ScalarGrid
from cccd.geometry.mesh import Mesh
from cccd.surface.booleans import between_planes
from cccd.surface.flat_caps import even_cap, run_on


def edges_of(mesh, height):
    """Lengths of the sides of the triangles that lie at a height."""
    corners = mesh.vertices[mesh.faces[(mesh.vertices[:, 2] == height)[mesh.faces].all(axis=1)]]
    return np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)


@pytest.mark.parametrize("height", [2.0, -2.0])
def test_a_ring_keeps_its_hole_and_gets_short_edges(height):
    ring = trimesh.creation.annulus(6, 10, 4, sections=100)
    ring = Mesh(ring.vertices, ring.faces)
    even = even_cap(ring, height, 0.7)
    assert even.is_closed_manifold
    assert (even.genus, even.volume) == (1, pytest.approx(ring.volume, rel=1e-9))
    assert edges_of(ring, height).max() > 3
    assert edges_of(even, height).max() < 1.6
    assert np.array_equal(
        np.sort(edges_of(even, -height), axis=None), np.sort(edges_of(ring, -height), axis=None)
    )


def test_a_rim_of_long_sides_stays_as_it_is():
    box = trimesh.creation.box((4, 4, 4))
    box = Mesh(box.vertices, box.faces)
    assert even_cap(box, 2.0, 0.3) is box
    assert even_cap(box, 1.5, 0.3) is box


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10**6), st.floats(-3, 3))
def test_whatever_a_plane_cuts_is_closed_and_does_not_pass_through_itself(seed, height):
    rng = np.random.default_rng(seed)
    points = np.stack(np.meshgrid(*[np.arange(-12, 12.1, 0.6)] * 3, indexing="ij"), -1)
    centres, radii = rng.uniform(-7, 7, (6, 3)), rng.uniform(2, 4, 6)
    values = np.min(
        [np.linalg.norm(points - c, axis=-1) - r for c, r in zip(centres, radii, strict=True)], axis=0
    )
    whole = ScalarGrid.uniform(values, (-12, -12, -12), 0.6).isosurface(0.0)
    below, above = between_planes(whole, -np.inf, height), between_planes(whole, height, np.inf)
    assert below.volume + above.volume == pytest.approx(whole.volume, rel=1e-9)
    for part in (below, above):
        even = even_cap(part, height, 0.75)
        assert len(even.faces) == 0 or even.is_closed_manifold
        assert len(even.self_intersections()) == 0
        assert even.volume == pytest.approx(part.volume, rel=1e-9)


def test_a_run_on_tube_is_longer_by_its_section():
    tin = trimesh.creation.cylinder(3, 2, sections=40)
    tin = Mesh(tin.vertices, tin.faces)
    section = tin.volume / 2
    longer = run_on(run_on(tin, 1.0, 2.5), -1.0, -1.25)
    assert longer.is_closed_manifold
    assert longer.volume == pytest.approx(tin.volume + 1.75 * section)
    assert np.ptp(longer.vertices[:, 2]) == pytest.approx(3.75)
