import numpy as np
import pytest
from support.solids import sphere

from cccd import metrics


def test_two_empty_regions_agree():
    nothing = np.zeros((2, 2), bool)
    assert metrics.dice(nothing, nothing) == 1
    with pytest.raises(ValueError, match="differ in shape"):
        metrics.dice(nothing, np.zeros((2, 3), bool))


def test_distances_are_seeded():
    first, second = (
        metrics.surface_distances(sphere(10), sphere(11), np.random.default_rng(3), 500) for _ in range(2)
    )
    assert first == second
