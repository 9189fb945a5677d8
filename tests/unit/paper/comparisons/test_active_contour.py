import numpy as np
import pytest
from support.known_curves import bean, circle

from cccd.geometry.raster import dice, rasterise
from cccd_paper.comparisons.active_contour import b_spline_snake, image_snake, seed_circle

SHAPE = (130, 150)


def overlap(curve: np.ndarray, truth: np.ndarray) -> float:
    return float(dice(rasterise([truth], (0, 0), SHAPE), rasterise([curve], (0, 0), SHAPE)))


@pytest.mark.parametrize("radius", [15.0, 60.0])
def test_the_snake_wraps_a_circle_of_corners(radius):
    truth = circle(60)
    assert overlap(b_spline_snake(truth, np.array([50.0, 60.0]), radius), truth) > 0.97


@pytest.mark.parametrize("radius", [12.0, 30.0, 55.0])
def test_the_snake_finds_a_bright_bean(radius):
    truth = bean(200)
    image = rasterise([truth], (0, 0), SHAPE) * 100.0 + 20
    assert overlap(image_snake(image, truth.mean(0), radius), truth) > 0.95


def test_without_corners_the_seed_stays():
    curve = b_spline_snake(np.zeros((0, 2)), np.array([40.0, 40.0]), 20.0)
    away = np.hypot(*(curve - 40).T)
    assert np.ptp(away) < 0.1
    assert 18 < away.mean() < 20


def test_the_snake_moves_with_its_input():
    truth = bean(40)
    shift = np.array([7.0, -9.0])
    here = b_spline_snake(truth, np.array([60.0, 70.0]), 70.0)
    there = b_spline_snake(truth + shift, np.array([60.0, 70.0]) + shift, 70.0)
    np.testing.assert_allclose(there, here + shift, atol=1e-6)


def test_the_seed_is_counter_clockwise():
    seed = seed_circle(np.array([5.0, 6.0]), 3.0)
    following = np.roll(seed, -1, axis=0)
    assert (seed[:, 0] * following[:, 1] - seed[:, 1] * following[:, 0]).sum() > 0
    assert np.hypot(*(seed - (5, 6)).T) == pytest.approx(3.0)
