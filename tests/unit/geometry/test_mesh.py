import numpy as np
import pytest
from support.solids import box, sphere, torus

from cccd.geometry.grid import ScalarGrid
from cccd.geometry.mesh import Mesh


def closed(faces):
    return Mesh(np.zeros((int(faces.max()) + 1, 3)), faces).is_closed_manifold


def together(*parts):
    return Mesh.joined(parts)


def test_volume_area_and_curvature_of_a_sphere():
    mesh = sphere(10)
    assert mesh.volume == pytest.approx(4 / 3 * np.pi * 1000, rel=5e-3)
    assert mesh.reversed().volume < 0
    assert mesh.area == pytest.approx(4 * np.pi * 100, rel=5e-3)
    assert mesh.curvature_per_area == pytest.approx(2 / 10, rel=1e-3)


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


def test_bodies_are_counted_and_cavities_are_not():
    shell = together(sphere(10), sphere(5).reversed())
    assert shell.count_bodies() == 1
    assert shell.genus == 0
    assert together(shell, together(torus(10, 3), torus(40, 3))).genus == 2
    assert shell.volume == pytest.approx(4 / 3 * np.pi * (1000 - 125), rel=5e-3)
    assert together(shell, sphere(4, (30, 0, 0))).count_bodies() == 2


@pytest.mark.parametrize("mirror", [1.0, -1.0])
def test_affine_maps_scale_the_volume_and_keep_the_outside(mirror):
    affine = np.array([[mirror * 2, 0.3, 0, 5], [0, 1.5, 0.2, -7], [0.1, 0, 0.5, 2], [0, 0, 0, 1.0]])
    mesh = sphere(10)
    moved = mesh.transformed(affine)
    assert moved.volume == pytest.approx(mesh.volume * abs(np.linalg.det(affine[:3, :3])))
    assert moved.is_closed_manifold


def test_samples_lie_on_the_surface_and_fill_it_evenly():
    points = box((2, 2, 2)).sample(60_000, np.random.default_rng(0))
    away = np.abs(points)
    assert away.max(axis=1) == pytest.approx(1)
    axis = np.argmax(away, axis=1)
    side = 2 * axis + (np.take_along_axis(points, axis[:, None], 1)[:, 0] > 0)
    assert np.bincount(side) == pytest.approx(10_000, rel=0.05)
    assert points.mean(axis=0) == pytest.approx(0, abs=0.02)


def test_simplified_keeps_size_and_volume():
    mesh = sphere(10, subdivisions=5)
    small = mesh.simplified(3000)
    assert 500 < len(small.faces) <= 3000
    assert small.volume == pytest.approx(mesh.volume, rel=2e-3)
    np.testing.assert_allclose(np.ptp(small.vertices, axis=0), 20, atol=0.01)
    assert mesh.simplified(len(mesh.faces)) is mesh


def test_vtk_s_mesh_outlives_ours():
    vtk_to_numpy = pytest.importorskip("vtkmodules.util.numpy_support").vtk_to_numpy
    known = sphere(10)
    apart = [sphere(10).to_vtk() for _ in range(20)]
    over = [np.full(3 * len(known.faces), n) for n in range(100)]  # takes the memory that is free by now
    assert len(over) == 100
    for other in apart:
        assert np.array_equal(vtk_to_numpy(other.GetPolys().GetConnectivityArray()), known.faces.ravel())
        assert np.array_equal(vtk_to_numpy(other.GetPoints().GetData()), known.vertices)


def test_trimesh_agrees_on_everything_it_measures():
    mesh = torus(10, 3)
    other = mesh.to_trimesh()
    assert mesh.volume == pytest.approx(other.volume, rel=1e-12)
    assert mesh.area == pytest.approx(other.area, rel=1e-12)
    assert mesh.genus == 1
    assert mesh.unit_normals == pytest.approx(other.face_normals, abs=1e-12)
    assert np.sort(mesh.dihedrals.angles) == pytest.approx(np.sort(other.face_adjacency_angles), abs=1e-7)


def test_nothing_is_empty():
    nothing = Mesh.empty()
    assert nothing.volume == nothing.area == 0
    assert not nothing.is_closed_manifold
    assert nothing.outwards() is nothing
    assert nothing.self_intersections().shape == (0, 2)


def test_a_low_pass_takes_ripples_off_a_ball_and_keeps_its_volume():
    axis = np.linspace(-1, 1, 41)
    distance = np.linalg.norm(np.meshgrid(axis, axis, axis), axis=0) - 0.8
    ball = ScalarGrid.uniform(distance, (-1, -1, -1), 0.05).isosurface(0.0)
    rng = np.random.default_rng(0)
    rough = Mesh(ball.vertices * (1 + 0.004 * rng.standard_normal((len(ball.vertices), 1))), ball.faces)
    smooth = rough.low_passed(0.05, 30)
    assert smooth.volume == pytest.approx(4 / 3 * np.pi * 0.8**3, rel=4e-3)
    assert np.linalg.norm(smooth.vertices, axis=1).std() < 0.3 * np.linalg.norm(rough.vertices, axis=1).std()
    assert smooth.curvature_per_area == pytest.approx(2 / 0.8, rel=0.3)  # the ripples' is eight times it
    assert smooth.is_closed_manifold


def test_normals_of_a_ball_point_away_from_its_centre():
    ball = sphere(8)
    outwards = np.einsum("vc,vc->v", ball.vertex_normals, ball.vertices)
    assert outwards.min() > 0.9999 * np.linalg.norm(ball.vertices, axis=1).max()
    assert np.allclose(np.linalg.norm(ball.vertex_normals, axis=1), 1)


def test_averaging_spreads_a_value_by_half_an_edge_each_time():
    ball = sphere(8)
    assert np.allclose(ball.averaged(np.ones(len(ball.vertices)), 3), 1)
    start = np.argmin(np.bincount(ball.faces.ravel()) != 6)  # in the middle of six triangles
    value = np.zeros(len(ball.vertices))
    value[start] = 1
    weight = ball.averaged(value, 40)
    edge = np.sqrt(4 / np.sqrt(3) * ball.area / len(ball.faces))
    square = ((ball.vertices - ball.vertices[start]) ** 2).sum(axis=1)
    assert np.sqrt((weight * square).sum() / weight.sum() / 2) == pytest.approx(
        0.5 * edge * np.sqrt(40), rel=0.01
    )
