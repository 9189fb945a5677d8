import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.interpolate import BSpline
from support.known_curves import random_spline

from cccd.curves import periodic
from cccd.geometry import closed_splines
from cccd.geometry.closed_splines import extend_knots


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(4, 40))
def test_least_squares_is_that_of_the_wrapped_design_matrix(seed, count):
    knots, _, rng = random_spline(seed, count)
    u = np.sort(rng.uniform(knots[3], knots[-4], 12 * count))
    points = rng.normal(size=(len(u), 2))
    design = BSpline.design_matrix(u, knots, 3).toarray()
    wrapped = design[:, :count].copy()
    wrapped[:, :3] += design[:, count:]
    assume(np.linalg.cond(wrapped) < 100)  # what the points do not tell the ridge decides
    best = points - wrapped @ np.linalg.lstsq(wrapped, points)[0]
    found = points - wrapped @ periodic.least_squares(knots, count, points, u)
    assert np.sum(found**2) == pytest.approx(np.sum(best**2), rel=1e-5)


def test_foot_points_are_nearest_points():
    angle = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    circle = 50 * np.column_stack([np.cos(angle), np.sin(angle)])
    breaks = np.arange(12) * 2 * np.pi / 12
    knots = extend_knots(breaks, 2 * np.pi)
    control = periodic.least_squares(knots, 12, circle, angle)
    rng = np.random.default_rng(0)
    away = rng.uniform(-5, 5, 60)
    started = np.sort(angle + rng.uniform(-0.04, 0.04, 60)) % (2 * np.pi)
    order = np.argsort(started)
    points = (circle * (1 + away[:, None] / 50))[order]
    parameters = started[order]
    distance = periodic.project(knots, control, points, parameters, 8)
    assert distance == pytest.approx(np.abs(away[order]), abs=0.02)
    assert np.all(np.diff(parameters) >= 0)


def test_three_rounds_of_sliding_along_tangents_are_as_near_as_any_number():
    angle = np.linspace(0, 2 * np.pi, 400, endpoint=False)
    shape = np.column_stack([80 * np.cos(angle), 30 * np.sin(angle) + 8 * np.sin(3 * angle)])
    step = np.linalg.norm(np.roll(shape, -1, axis=0) - shape, axis=1)
    start, period = np.cumsum(step) - step, step.sum()
    knots = extend_knots(np.arange(14) * period / 14, period)

    def rounds(count):
        u = start.copy()
        control = periodic.least_squares(knots, 14, shape, u)
        distance = periodic.project(knots, control, shape, u, 4)
        for _ in range(count):
            control = periodic.tangent_least_squares(knots, control, shape, np.ones(400), u, 0.03)
            distance = periodic.project(knots, control, shape, u, 4)
        return np.sqrt(np.mean(distance**2))

    assert rounds(3) == pytest.approx(rounds(40), rel=0.02)
    assert rounds(40) < 0.034  # of an outline 80 long


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(4, 30), st.booleans())
def test_evaluation_agrees_with_scipy_and_closes(seed, count, repeated):
    knots, control, _ = random_spline(seed, count, repeated)
    assert len(knots) == count + 7
    curve = BSpline(knots, np.vstack([control, control[:3]]), 3)
    u = np.linspace(knots[3], knots[-4], 101)[:-1]
    assert closed_splines.evaluate(knots, control, u) == pytest.approx(curve(u), abs=1e-9)
    assert curve(knots[3]) == pytest.approx(curve(knots[-4]), abs=1e-9)
