import numpy as np
import pytest
import trimesh

from cccd.containers import Frame
from cccd.metrics import (
    bending_per_area,
    count_self_intersections,
    curvature_per_area,
    is_closed_manifold,
    mesh_area,
    mesh_volume,
    surface_distances,
    voxelise,
)


def sphere(radius=10.0, centre=(0, 0, 0), subdivisions=4):
    mesh = trimesh.creation.icosphere(subdivisions, radius)
    return np.array(mesh.vertices) + centre, np.array(mesh.faces, np.int64)


def test_volume_area_and_bending_of_a_sphere():
    vertices, faces = sphere(10)
    assert mesh_volume(vertices, faces) == pytest.approx(4 / 3 * np.pi * 1000, rel=5e-3)
    assert mesh_volume(vertices, faces[:, ::-1]) < 0
    assert mesh_area(vertices, faces) == pytest.approx(4 * np.pi * 100, rel=5e-3)
    assert curvature_per_area(vertices, faces) == pytest.approx(2 / 10, rel=0.02)
    # k1 = k2 = 1 / R: the integrand is 2 / R^2 everywhere.
    assert bending_per_area(vertices, faces) == pytest.approx(2 / 100, rel=0.1)


@pytest.mark.parametrize("scale", [0.5, 3.0])
def test_bending_scales_with_the_inverse_square(scale):
    vertices, faces = sphere(10)
    assert bending_per_area(scale * vertices, faces) == pytest.approx(
        bending_per_area(vertices, faces) / scale**2
    )


def test_concentric_spheres_are_their_radii_apart():
    figures = surface_distances(sphere(10), sphere(12), np.random.default_rng(0), 5000)
    assert figures["assd"] == pytest.approx(2, abs=0.03)
    assert figures["hd95"] == pytest.approx(2, abs=0.05)
    assert figures["hausdorff"] >= figures["hd95"]


def test_distances_are_seeded():
    first, second = (
        surface_distances(sphere(10), sphere(11), np.random.default_rng(3), 500) for _ in range(2)
    )
    assert first == second


def test_closedness_sees_holes_flips_and_touching_vertices():
    _, faces = sphere()
    assert is_closed_manifold(faces)
    assert not is_closed_manifold(faces[1:])
    flipped = faces.copy()
    flipped[0] = flipped[0, ::-1]
    assert not is_closed_manifold(flipped)
    assert not is_closed_manifold(np.vstack([faces, faces]))
    # Two tetrahedra that share one vertex: every edge is fine, the vertex is not.
    tetrahedron = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
    other = np.array([[0, 5, 4], [0, 4, 6], [4, 5, 6], [0, 6, 5]])
    assert is_closed_manifold(tetrahedron)
    assert not is_closed_manifold(np.vstack([tetrahedron, other]))


def test_self_intersections_are_found_and_only_they():
    vertices, faces = sphere()
    assert count_self_intersections(vertices, faces) == 0
    other, more = sphere(10, (12.3, 0.7, 0.4))
    both = np.vstack([vertices, other]), np.vstack([faces, more + len(vertices)])
    assert count_self_intersections(*both) > 20
    apart = np.vstack([vertices, other + np.array([30, 0, 0])]), both[1]
    assert count_self_intersections(*apart) == 0


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
    assert count_self_intersections(vertices, faces) == expected


@pytest.mark.parametrize("mirror", [1, -1])
def test_voxels_of_a_sphere(mirror):
    affine = np.diag([mirror * 0.5, 0.7, 1.0, 1.0])
    frame = Frame(affine, 2, (60, 60, 40))
    centre = affine[:3, :3] @ (30, 30, 20)
    vertices, faces = sphere(9.3, centre)
    index = np.stack(np.meshgrid(*map(np.arange, frame.shape), indexing="ij"), axis=-1)
    inside = np.linalg.norm(index @ affine[:3, :3].T - centre, axis=-1) <= 9.3
    found = voxelise(vertices, faces, frame, np.zeros(3), frame.shape)
    assert np.count_nonzero(found ^ inside) < 0.01 * inside.sum()
    part = voxelise(vertices, faces, frame, np.array([20, 10, 15]), (20, 30, 10))
    assert np.array_equal(part, found[20:40, 10:40, 15:25])
