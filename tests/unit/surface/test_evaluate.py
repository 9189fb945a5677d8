import dataclasses

import numpy as np
import pytest
from scipy.interpolate import BSpline

from cccd.containers import Patch
from cccd.metrics import is_closed_manifold, mesh_volume
from cccd.surface.bsplines import basis, closed_knots, least_squares, open_knots
from cccd.surface.evaluate import differential_geometry, evaluate, swollen, tessellate


def cylinder(radius=10.0, height=30.0, around=24, along=6) -> Patch:
    """A tube whose closed splines are fitted to a circle."""
    u = np.arange(400) / 400
    knots_u, knots_v = closed_knots(around), open_knots(along, height)
    circle = radius * np.column_stack([np.cos(2 * np.pi * u), np.sin(2 * np.pi * u)])
    ring = least_squares(basis(u, knots_u, 3, True), 0.0, True) @ circle
    z = np.array([knots_v[n + 1 : n + 4].mean() for n in range(along)])
    net = np.empty((around, along, 3))
    net[..., :2], net[..., 2] = ring[:, None], z
    return Patch(net, np.ones((around, along)), knots_u, knots_v, 3, 3, True, False, 1)


def random_parameters(patch, count=50):
    rng = np.random.default_rng(1)
    return rng.random(count), rng.random(count) * patch.knots_v[-1]


@pytest.mark.parametrize("count", [5, 8, 21])
def test_closed_basis_sums_to_one_and_has_no_seam(count):
    knots = closed_knots(count)
    u = np.linspace(0, 1, 57)
    assert basis(u, knots, 3, True).sum(axis=1) == pytest.approx(1)
    for order in range(3):
        before, after = basis(np.array([1 - 1e-12, 0.0]), knots, 3, True, order)
        assert before == pytest.approx(after, abs=1e-4 * count**order)


def test_closed_basis_agrees_with_the_documented_wrapping():
    control = np.random.default_rng(0).random((9, 2))
    knots = closed_knots(9)
    spline = BSpline(knots, np.vstack([control, control[:3]]), 3)
    u = np.linspace(0, 0.999, 31)
    assert basis(u, knots, 3, True) @ control == pytest.approx(spline(u))


def test_least_squares_gives_back_a_spline():
    control = np.random.default_rng(0).random((12, 2))
    design = basis(np.arange(200) / 200, closed_knots(12), 3, True)
    assert least_squares(design, 0.0, True) @ (design @ control) == pytest.approx(control, abs=1e-8)


def test_a_cylinder_has_its_curvatures():
    patch = cylinder()
    geometry = differential_geometry(patch, *random_parameters(patch))
    assert geometry.gaussian == pytest.approx(0, abs=1e-6)
    assert geometry.mean == pytest.approx(1 / 20, rel=2e-2)
    radial = geometry.points[:, :2] / np.linalg.norm(geometry.points[:, :2], axis=1, keepdims=True)
    assert np.sum(geometry.normals[:, :2] * radial, axis=1) == pytest.approx(1, abs=1e-3)


@pytest.mark.parametrize("order", [(1, 0), (0, 1), (1, 1), (2, 0), (0, 2)])
def test_rational_derivatives_are_difference_quotients(order):
    patch = cylinder()
    rng = np.random.default_rng(2)
    patch = dataclasses.replace(patch, weights=rng.uniform(0.5, 2, patch.weights.shape))
    u, v = random_parameters(patch)
    u, v = 0.1 + 0.8 * u, 1 + 0.9 * v
    h = {"u": 1e-4, "v": 3e-3}

    def difference(orders, u, v):
        a, b = orders
        if a:
            return (difference((a - 1, b), u + h["u"], v) - difference((a - 1, b), u - h["u"], v)) / (
                2 * h["u"]
            )
        if b:
            return (difference((a, b - 1), u, v + h["v"]) - difference((a, b - 1), u, v - h["v"])) / (
                2 * h["v"]
            )
        return evaluate(patch, u, v)

    exact = evaluate(patch, u, v, order)
    assert np.abs(exact - difference(order, u, v)).max() < 2e-2 * max(1.0, np.abs(exact).max())


def test_equal_weights_do_nothing():
    patch = cylinder()
    u, v = random_parameters(patch)
    heavy = dataclasses.replace(patch, weights=np.full_like(patch.weights, 3.0))
    assert evaluate(heavy, u, v) == pytest.approx(evaluate(patch, u, v))


@pytest.mark.parametrize("edge", [0.7, 2.0, 6.0])
def test_meshes_of_any_density_are_closed(edge):
    vertices, faces = tessellate(cylinder(), edge)
    assert is_closed_manifold(faces)
    assert mesh_volume(vertices, faces) == pytest.approx(np.pi * 100 * 30, rel=0.01 + 0.01 * edge**2)


def test_denser_meshes_have_more_triangles():
    coarse, fine = (len(tessellate(cylinder(), edge)[1]) for edge in (2.0, 1.0))
    assert fine > 3 * coarse


@pytest.mark.parametrize("mirror", [1.0, -1.0])
def test_swelling_moves_the_wall_outwards(mirror):
    patch = cylinder()
    patch = dataclasses.replace(patch, control_points=patch.control_points * [mirror, 1, 1])
    wider = swollen(patch, 0.5, np.array([0, 0, 1.0]))
    points = evaluate(wider, *random_parameters(patch))
    assert np.hypot(points[:, 0], points[:, 1]) == pytest.approx(10.5, abs=0.02)
    assert wider.control_points[..., 2] == pytest.approx(patch.control_points[..., 2])
