"""The conformal factor: exact against order statistics, and it covers what it says in simulation."""

import numpy as np
import pytest

from cccd_calibration.conformal import FACTORS, coverage_curve, fewest_organs, smallest_factor


def test_one_score_per_organ_gives_the_conformal_quantile():
    rng = np.random.default_rng(0)
    for count, share in ((9, 0.9), (19, 0.9), (30, 0.8), (99, 0.95)):
        scores = rng.lognormal(0, 1, (count, 1))
        factor = smallest_factor(np.array([coverage_curve(of) for of in scores]), range(count), share)
        rank = int(np.ceil((count + 1) * share - 1e-9))
        expected = np.sort(scores[:, 0])[rank - 1]
        assert expected <= factor < max(expected * 1.0251, FACTORS[0] * 1.0001)


def test_too_few_organs_guarantee_nothing():
    curves = np.array([coverage_curve(np.ones(5))] * 8)
    assert fewest_organs(0.9) == 9
    assert smallest_factor(curves, range(8), 0.9) is None
    assert smallest_factor(curves, range(8), 0.8) is not None


@pytest.mark.parametrize("share", [0.8, 0.9])
def test_a_further_organ_is_covered_on_the_mean(share):
    """Organs differ in how far they are off; exchangeable ones are covered as promised, hardly more."""
    rng = np.random.default_rng(1)
    count, covered = 40, []
    for _ in range(300):
        scores = np.abs(rng.standard_normal((count + 1, 200))) * rng.lognormal(0, 0.3, (count + 1, 1))
        factor = smallest_factor(np.array([coverage_curve(of) for of in scores[:-1]]), range(count), share)
        covered.append((scores[-1] <= factor).mean())
    spread = np.std(covered) / np.sqrt(len(covered))
    assert share - 3 * spread <= np.mean(covered) <= share + 1 / (count + 1) + 0.01 + 3 * spread


def test_what_is_not_a_number_is_not_covered():
    curve = coverage_curve(np.array([0.5, np.nan, np.inf, 0.5]))
    assert curve[-1] == 0.5
    assert np.all(np.diff(curve) >= 0)
