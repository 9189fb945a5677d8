import dataclasses

import numpy as np
import pytest
from patches import cylinder, random_parameters
from scipy.interpolate import BSpline

from cccd.geometry.bsplines import basis, closed_knots, smoothing_operator


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
    assert smoothing_operator(design, 0.0, True) @ (design @ control) == pytest.approx(control, abs=1e-8)


def test_a_cylinder_has_its_curvatures():
    patch = cylinder()
    geometry = patch.differential_geometry(*random_parameters(patch))
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
        return patch.evaluate(u, v)

    exact = patch.evaluate(u, v, order)
    assert np.abs(exact - difference(order, u, v)).max() < 2e-2 * max(1.0, np.abs(exact).max())


def test_equal_weights_do_nothing():
    patch = cylinder()
    u, v = random_parameters(patch)
    heavy = dataclasses.replace(patch, weights=np.full_like(patch.weights, 3.0))
    assert heavy.evaluate(u, v) == pytest.approx(patch.evaluate(u, v))
