import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.sparse import csr_array

from cccd.geometry.averaging import averaged


@given(st.integers(0, 150), st.integers(0, 1000))
def test_averages_are_what_averaging_again_and_again_gives(rounds, seed):
    rng = np.random.default_rng(seed)
    links = np.triu(rng.random((40, 40)) < 0.15, 1)
    links |= links.T
    lone = ~links.any(axis=1)
    links[lone, lone] = True
    means = csr_array(links / links.sum(axis=1, keepdims=True))
    values = rng.standard_normal(40)
    average, expected = averaged(means, values, rounds), values
    for _ in range(rounds):
        expected = 0.5 * (expected + means @ expected)
    np.testing.assert_allclose(average, expected, atol=2e-3)
    np.testing.assert_allclose(average[lone], values[lone])
