"""The measures of the exact-truth benchmark on surfaces whose answers are known."""

from functools import partial

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.closed_shapes import box, moved, sphere, together, torus
from truth_measures import (
    Target,
    bending,
    compare,
    euler_number,
    from_polydata,
    inside,
    mean_distance,
    open_edges,
    sample_surface,
    to_image,
    transformed,
    wrong_voxels,
)

from cccd.geometry.mesh import Mesh

ball = partial(sphere, subdivisions=5)
cube = partial(box, (20, 20, 20))


def grid(shape, affine):
    index = np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1)
    return index @ affine[:3, :3].T + affine[:3, 3]


def turned_affine(shape, step, flip=1):
    affine = np.eye(4)
    affine[:3, :3] = Rotation.from_euler("xyz", (20, -35, 50), degrees=True).as_matrix() * step * (flip, 1, 1)
    affine[:3, 3] = -affine[:3, :3] @ ((np.array(shape) - 1) / 2) + (0.1, 0.2, 0.3)
    return affine


def test_concentric_balls_are_their_difference_of_radii_apart():
    found = compare(ball(11), Target(ball(10)))
    assert found["assd_mm"] == pytest.approx(1, abs=0.005)
    assert found["hd95_mm"] == pytest.approx(1, abs=0.005)
    assert found["farthest_mm"] == pytest.approx(1, abs=0.01)
    assert found["normals_median_deg"] < 1.5
    assert mean_distance(ball(11), Target(ball(10))) == pytest.approx(found["assd_mm"], abs=0.001)


def test_a_surface_is_no_distance_from_itself_whatever_its_orientation():
    mesh = ball(10)
    found = compare(Mesh(mesh.vertices, mesh.faces[:, ::-1]), Target(mesh))
    # square roots of rounding errors, and acos of nearly 1
    assert max(found["farthest_mm"], found["normals_90_deg"]) < 1e-5


def test_a_shifted_box_is_off_on_two_of_its_six_faces():
    found = compare(moved(cube(), (1, 0, 0)), Target(cube()))
    assert found["assd_mm"] == pytest.approx(1 / 3, abs=0.01)
    assert found["farthest_mm"] == pytest.approx(1, abs=1e-9)
    assert found["normals_median_deg"] == pytest.approx(0, abs=1e-5)


def test_both_surfaces_count():
    # one ball of two is found; whoever looks from the one to the two alone sees nothing
    one, two = ball(5), together(ball(5), ball(5, (30, 0, 0)))
    assert compare(one, Target(two))["farthest_mm"] == pytest.approx(
        compare(two, Target(one))["farthest_mm"], 0.01
    )
    assert compare(one, Target(two))["farthest_mm"] > 28


def test_samples_are_uniform_over_the_area():
    points, face = sample_surface(box((40, 10, 10)), 20_000, np.random.default_rng(0))
    ends = np.isclose(np.abs(points[:, 0]), 20)
    assert ends.mean() == pytest.approx(200 / 1800, abs=0.01)
    assert points.mean(axis=0) == pytest.approx([0, 0, 0], abs=0.3)
    assert set(face) == set(range(12))


def test_bending_of_a_ball_and_a_box():
    assert bending(ball(10)) == pytest.approx(2 / 10, rel=0.01)
    # twelve edges of 20, a quarter turn each, over six faces
    assert bending(cube()) == pytest.approx(12 * 20 * np.pi / 2 / 2400)


def test_euler_numbers_and_open_edges():
    hollow = together(ball(10), ball(5))
    ring = torus()
    assert [euler_number(mesh) for mesh in (ball(10), ring, hollow)] == [2, 0, 4]
    assert [open_edges(mesh) for mesh in (ball(10), ring, hollow)] == [0, 0, 0]
    holed = Mesh(ball(10).vertices, ball(10).faces[1:])
    assert (open_edges(holed), euler_number(holed)) == (3, 1)
    # a vertex without faces does not count
    assert euler_number(Mesh(np.vstack([cube().vertices, [99, 99, 99]]), cube().faces)) == 2


@pytest.mark.parametrize("flip", [1, -1])
def test_inside_is_known_for_a_ball_on_an_oblique_grid(flip):
    shape, step = (30, 28, 12), (1.0, 1.0, 2.5)
    affine = turned_affine(shape, step, flip)
    away = np.linalg.norm(grid(shape, affine), axis=-1)
    sure = np.abs(away - 10) > 0.01  # the icosphere's chords
    assert np.array_equal(inside(ball(10), affine, shape)[sure], (away < 10)[sure])


def test_nothing_is_inside_an_empty_mesh_and_a_cavity_is_outside():
    shape, affine = (25, 25, 25), turned_affine((25, 25, 25), 1.0)
    assert not inside(Mesh.empty(), affine, shape).any()
    hollow = inside(together(ball(10), ball(5)), affine, shape)
    assert np.array_equal(hollow, inside(ball(10), affine, shape) & ~inside(ball(5), affine, shape))


def test_voxels_of_a_ball_that_is_too_small_are_counted():
    shape, affine = (31, 31, 13), turned_affine((31, 31, 13), (0.8, 0.8, 2.0))
    away = np.linalg.norm(grid(shape, affine), axis=-1)
    mask = away < 10
    count, farthest = wrong_voxels(ball(8), mask, affine)
    # pixels are of .8 mm: what lies further than .6 mm out of the ball of 8 mm is wrong
    assert count == pytest.approx(np.count_nonzero(mask & (away > 8.6)), abs=2)
    assert farthest == pytest.approx((away[mask].max() - 8) / 0.8, abs=0.01)


def test_voxels_that_the_surface_takes_in_count_too():
    shape, affine = (31, 31, 31), turned_affine((31, 31, 31), 1.0)
    away = np.linalg.norm(grid(shape, affine), axis=-1)
    count, farthest = wrong_voxels(ball(12), away < 10, affine)
    assert count == pytest.approx(np.count_nonzero((away >= 10) & (away < 11.25)), abs=6)
    assert 1.9 < farthest <= 2.01


def test_no_voxel_is_wrong_for_its_own_isosurface():
    import vtk

    mask = np.pad(np.random.default_rng(1).random((12, 12, 12)) < 0.4, 2)
    edges = vtk.vtkFlyingEdges3D()
    edges.SetInputData(to_image(mask.astype(np.float32)))
    edges.SetValue(0, 0.5)
    edges.Update()
    affine = turned_affine(mask.shape, (1.0, 1.0, 3.0))
    mesh = transformed(from_polydata(edges.GetOutput()), affine)
    assert wrong_voxels(mesh, mask, affine) == (0, 0.0)
    assert wrong_voxels(Mesh.empty(), mask, affine) == (mask.sum(), np.inf)
