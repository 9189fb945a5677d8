import numpy as np
import pytest
from solids import sphere

from cccd.geometry.mesh import Mesh


def closed(faces):
    return Mesh(np.zeros((int(faces.max()) + 1, 3)), faces).is_closed_manifold


def together(first, second):
    faces = np.vstack([first.faces, second.faces + len(first.vertices)])
    return Mesh(np.vstack([first.vertices, second.vertices]), faces)


def test_volume_area_and_bending_of_a_sphere():
    mesh = sphere(10)
    assert mesh.volume == pytest.approx(4 / 3 * np.pi * 1000, rel=5e-3)
    assert mesh.reversed().volume < 0
    assert mesh.area == pytest.approx(4 * np.pi * 100, rel=5e-3)
    assert mesh.curvature_per_area == pytest.approx(2 / 10, rel=0.02)
    # k1 = k2 = 1 / R: the integrand is 2 / R^2 everywhere.
    assert mesh.bending_per_area == pytest.approx(2 / 100, rel=0.1)


@pytest.mark.parametrize("scale", [0.5, 3.0])
def test_bending_scales_with_the_inverse_square(scale):
    mesh = sphere(10)
    scaled = mesh.transformed(np.diag([scale, scale, scale, 1]))
    assert scaled.bending_per_area == pytest.approx(mesh.bending_per_area / scale**2)


def test_closedness_sees_holes_flips_and_touching_vertices():
    faces = sphere().faces
    assert closed(faces)
    assert not closed(faces[1:])
    flipped = faces.copy()
    flipped[0] = flipped[0, ::-1]
    assert not closed(flipped)
    assert not closed(np.vstack([faces, faces]))
    # Two tetrahedra that share one vertex: every edge is fine, the vertex is not.
    tetrahedron = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
    other = np.array([[0, 5, 4], [0, 4, 6], [4, 5, 6], [0, 6, 5]])
    assert closed(tetrahedron)
    assert not closed(np.vstack([tetrahedron, other]))


def test_self_intersections_are_found_and_only_they():
    mesh = sphere()
    assert len(mesh.self_intersections()) == 0
    assert len(together(mesh, sphere(10, (12.3, 0.7, 0.4))).self_intersections()) > 20
    assert len(together(mesh, sphere(10, (42.3, 0.7, 0.4))).self_intersections()) == 0


def test_every_crossing_pair_is_found():
    rng = np.random.default_rng(0)
    corners = rng.random((60, 1, 3)) + 0.25 * rng.normal(size=(60, 3, 3))
    vertices, faces = corners.reshape(-1, 3), np.arange(180).reshape(-1, 3)

    def pierces(a, b, triangle):
        p, q, r = triangle
        normal = np.cross(q - p, r - p)
        along = normal @ (b - a)
        t = normal @ (p - a) / along
        weights = np.linalg.solve(np.array([p, q, r]).T, a + t * (b - a))
        return 0 < t < 1 and np.all(weights > 0)

    def crossing(one, two):
        edges = [(n, (n + 1) % 3) for n in range(3)]
        return any(pierces(one[i], one[j], two) or pierces(two[i], two[j], one) for i, j in edges)

    expected = sum(crossing(corners[i], corners[j]) for i in range(60) for j in range(i))
    assert expected > 10
    assert len(Mesh(vertices, faces).self_intersections()) == expected


def test_outwards_turns_an_inside_out_mesh_and_no_other():
    mesh = sphere(3.0, (100, 100, 100), 2)
    assert mesh.outwards() is mesh
    np.testing.assert_array_equal(mesh.reversed().outwards().faces, mesh.faces)
