import numpy as np
import pytest
from scipy.interpolate import BSpline

from cccd.geometry.bsplines import basis, closed_knots


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
