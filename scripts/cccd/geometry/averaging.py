"""Values averaged along a mesh over a length."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import scipy

from cccd.geometry.arrays import FloatArray

__all__ = ["averaged"]

#: What is left out of an average may weigh so much in all.
NEGLIGIBLE = 1e-4


def averaged(means: scipy.sparse.csr_array, values: FloatArray, rounds: int) -> FloatArray:
    r"""Average vertices' values (V,) with the mean of their neighbours, so many times over.

    Parameters
    ----------
    means : (V, V) float64
        Gives each vertex the mean of its neighbours, or its own value.
    values : (V,) float64
    rounds : int

    Notes
    -----
    With :math:`M` for the means this is :math:`((1 + M) / 2)^n v`. As :math:`((1 + \cos t) / 2)^n` is the
    sum of :math:`\binom{2 n}{n - k} \cos(k t) / 4^n` over k from -n to n, it is a sum of Chebyshev
    polynomials of M as well, whose weights fade like a Gaussian: a few times :math:`\sqrt n` products with M
    do.

    Examples
    --------
    Two neighbours become alike at once.

    >>> averaged(scipy.sparse.csr_array([[0.0, 1.0], [1.0, 0.0]]), np.array([0.0, 1.0]), 1)
    array([0.5, 0.5])
    """
    total = np.zeros_like(values)
    for weight, polynomial in zip(_weights(rounds), _polynomials(means, values), strict=False):
        total += weight * polynomial
    return total


def _polynomials(means: scipy.sparse.csr_array, values: FloatArray) -> Iterator[FloatArray]:
    """Yield Chebyshev polynomials of the means, of rising degree, times the values (V,)."""
    yield values
    before, polynomial = values, means @ values
    while True:
        yield polynomial
        before, polynomial = polynomial, 2 * (means @ polynomial) - before


def _weights(rounds: int) -> FloatArray:
    """Weights (K,) of the Chebyshev polynomials of degree 0 to K - 1, of sum 1."""
    k = np.arange(rounds)
    weights = np.concatenate([[0.5], np.cumprod((rounds - k) / (rounds + k + 1))])
    weights /= weights.sum()
    kept = weights[: np.count_nonzero(np.cumsum(weights[::-1])[::-1] > NEGLIGIBLE)]
    return kept / kept.sum()
