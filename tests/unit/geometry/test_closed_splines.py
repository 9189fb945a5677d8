import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import BSpline
from support.known_curves import random_spline

from cccd.geometry.closed_splines import evaluate


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(4, 30), st.booleans())
def test_evaluation_agrees_with_scipy_and_closes(seed, count, repeated):
    knots, control, _ = random_spline(seed, count, repeated)
    assert len(knots) == count + 7
    curve = BSpline(knots, np.vstack([control, control[:3]]), 3)
    u = np.linspace(knots[3], knots[-4], 101)[:-1]
    assert evaluate(knots, control, u) == pytest.approx(curve(u), abs=1e-9)
    assert curve(knots[3]) == pytest.approx(curve(knots[-4]), abs=1e-9)
