import numpy as np
import pytest
import trimesh
from support.closed_shapes import mesh_of, sphere, together, torus

from cccd.geometry.decimation import collapse_apart, collapse_edges
from cccd.geometry.mesh import Mesh
from cccd_solids.bodies import split_bodies


@pytest.mark.parametrize("mesh", [sphere(), torus()])
@pytest.mark.parametrize("most", [600, 60])
def test_topology_is_kept(mesh, most):
    fewer = collapse_edges(mesh, most)
    assert len(fewer.faces) == most
    assert fewer.is_closed_manifold
    assert fewer.genus == mesh.genus
    assert len(fewer.self_intersections()) == 0


def test_planes_cost_next_to_nothing():
    box = trimesh.creation.box((4, 5, 6)).subdivide().subdivide().subdivide()
    fewer = collapse_edges(mesh_of(box), 40)
    assert fewer.volume == pytest.approx(120, rel=2e-3)


def test_the_ring_is_not_pinched():
    """A torus as thin as three triangles around cannot lose one of them."""
    ring = mesh_of(trimesh.creation.torus(10, 1, major_sections=30, minor_sections=3))
    fewer = collapse_edges(ring, 4)
    assert fewer.is_closed_manifold
    assert fewer.genus == 1


def test_a_thin_wall_stays_a_wall():
    """A ball and a cavity that comes near to its surface on one side."""
    wall = together(sphere(10.0, subdivisions=4), sphere(8.0, (1.8, 0.3, 0.1), subdivisions=4).reversed())
    assert len(wall.self_intersections()) == 0
    assert len(collapse_edges(wall, 300).self_intersections()) > 0
    apart = collapse_apart(wall, 300)
    assert len(apart.self_intersections()) == 0
    assert len(apart.faces) == 300
    assert apart.volume == pytest.approx(wall.volume, rel=0.05)


def test_weights_decide_where_triangles_stay():
    ball = sphere(10.0, subdivisions=4)
    upper = ball.vertices[:, 2] > 0
    fewer = collapse_edges(ball, 400, weights=np.where(upper, 256.0, 1.0))
    above = (fewer.vertices[fewer.faces].mean(axis=1)[:, 2] > 0).sum()
    assert above > 0.7 * len(fewer.faces)


def test_the_mesh_stays_as_it_was():
    mesh = sphere()
    vertices, faces = mesh.vertices.copy(), mesh.faces.copy()
    collapse_edges(mesh, 100)
    assert np.array_equal(mesh.vertices, vertices)
    assert np.array_equal(mesh.faces, faces)


def test_islands_in_cavities_are_bodies():
    shells = [
        sphere(10.0),
        sphere(7.0).reversed(),
        sphere(4.0),
        sphere(2.0).reversed(),
        sphere(3.0, (30, 0, 0)),
    ]
    bodies = split_bodies(together(*shells[::-1]))
    volumes = [[round(piece.volume) for piece in body] for body in bodies]
    expected = [[round(mesh.volume) for mesh in pair] for pair in (shells[:2], shells[2:4], shells[4:])]
    assert volumes == expected


def test_a_cavity_in_nothing_is_refused():
    with pytest.raises(ValueError, match="cavity"):
        split_bodies(together(sphere(), sphere(2.0, (50, 0, 0)).reversed()))


def test_pieces_use_all_their_vertices():
    pieces = together(sphere(), torus()).pieces()
    assert sorted(piece.genus for piece in pieces) == [0, 1]
    assert all(np.array_equal(np.unique(p.faces), np.arange(len(p.vertices))) for p in pieces)
    assert Mesh.empty().pieces() == []
