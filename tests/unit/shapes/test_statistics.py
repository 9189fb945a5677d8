"""Modes, their measures and the permutation test, on shapes of known distribution."""

import numpy as np
import pytest
from scipy.sparse import csr_array, eye_array

from cccd_shapes.statistics import compare_groups, distances_to_others, measure_model, principal_modes

POINTS = 40
METRIC = csr_array(eye_array(POINTS) / POINTS)


def shapes_of(scores):
    """Shapes of two known modes: rows of scores in mm, root mean square over the points."""
    draw = np.random.default_rng(0)
    ways = np.linalg.qr(draw.normal(size=(3 * POINTS, 2)))[0].T * np.sqrt(POINTS)
    return draw.normal(size=(1, POINTS, 3)) + (scores @ ways).reshape(-1, POINTS, 3)


def test_known_modes_are_found_with_their_deviations():
    scores = np.random.default_rng(1).normal(size=(400, 2)) * (3.0, 1.0)
    model = principal_modes(shapes_of(scores), METRIC)
    assert len(model.deviations) == 2
    assert model.deviations == pytest.approx([3, 1], rel=0.1)
    assert model.scores.std(axis=0, ddof=1) == pytest.approx(np.ones(2))
    assert np.einsum("kvc,kvc->k", model.modes, model.modes) / POINTS == pytest.approx(np.ones(2))
    assert model.shape(model.scores[7]) == pytest.approx(shapes_of(scores)[7])


def test_measures_are_those_of_a_known_distribution():
    """With one of two modes, what is left is the other's size; with both, nothing."""
    scores = np.random.default_rng(2).normal(size=(200, 2)) * (4.0, 1.0)
    quality = measure_model(principal_modes(shapes_of(scores), METRIC))
    assert quality["compactness"] == pytest.approx([16 / 17, 1], abs=0.02)
    assert quality["generalisation_mm"] == pytest.approx([np.sqrt(2 / np.pi), 0], abs=0.08)
    assert np.all(np.diff(quality["specificity_mm"]) < 0.5)
    assert quality["specificity_mm"][0] < 1


def test_what_no_mixture_makes_is_far_from_the_others():
    shapes = shapes_of(np.random.default_rng(3).normal(size=(20, 2)))
    shapes[4] += np.random.default_rng(4).normal(size=(POINTS, 3))
    off = distances_to_others(principal_modes(shapes, METRIC))
    assert off.argmax() == 4
    assert off[4] > 10 * np.median(off)


def test_a_group_effect_is_found_where_it_is():
    draw = np.random.default_rng(5)
    shapes = draw.normal(size=(1, POINTS, 3)) + 0.3 * draw.normal(size=(30, POINTS, 3))
    groups = ["a", "b"] * 15
    shapes[1::2, :5] += 1.0
    test = compare_groups(principal_modes(shapes, METRIC), shapes, groups, 199)
    assert test.p <= 0.01
    assert np.all(test.p_points[:5] <= 0.01)
    assert np.mean(test.p_points[5:] < 0.05) < 0.1
    assert test.difference[:5].mean() == pytest.approx(1.0, abs=0.15)
    assert np.all(test.p_points >= test.p_points_alone - 1e-12)


def test_an_effect_in_a_mode_of_a_fiftieth_of_the_variance_is_found():
    scores = np.random.default_rng(9).normal(size=(40, 2)) * (3.0, 0.4)
    scores[1::2, 1] += 0.5
    shapes = shapes_of(scores)
    assert compare_groups(principal_modes(shapes, METRIC), shapes, ["a", "b"] * 20, 199).p <= 0.01


def test_without_an_effect_the_level_is_kept():
    """Of 100 cohorts without a difference few are called different: .05 times 100 is 5."""
    draw = np.random.default_rng(6)
    wrong, wrong_points = 0, 0
    for _ in range(100):
        shapes = draw.normal(size=(14, POINTS, 3))
        test = compare_groups(principal_modes(shapes, METRIC), shapes, ["a", "b"] * 7, 59)
        wrong += test.p <= 0.05
        wrong_points += test.p_points.min() <= 0.05
    assert wrong <= 11
    assert wrong_points <= 11


def test_three_groups_are_compared_too():
    shapes = np.random.default_rng(7).normal(size=(30, POINTS, 3))
    shapes[2::3] += 2
    test = compare_groups(principal_modes(shapes, METRIC), shapes, ["a", "b", "c"] * 10, 99)
    assert test.p == pytest.approx(0.01)
