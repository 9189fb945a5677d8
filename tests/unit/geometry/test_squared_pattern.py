"""A weighted matrix times its own transpose, on a pattern that is found once."""

import numpy as np
from scipy.sparse import csr_array, random_array

from cccd.geometry.squared_pattern import SquaredPattern


def test_products_are_those_of_full_matrices_whatever_the_values():
    rng = np.random.default_rng(0)
    matrix = csr_array(random_array((40, 17), density=0.2, rng=rng))
    matrix.sort_indices()
    squared = SquaredPattern(matrix)
    for _ in range(3):
        data, weights = rng.normal(size=matrix.nnz), rng.uniform(-1, 1, 40)
        full = csr_array((data, matrix.indices, matrix.indptr), shape=matrix.shape).toarray()
        product = squared.product(0, data, weights)
        np.testing.assert_allclose(product.toarray(), full.T @ (weights[:, None] * full), atol=1e-12)
        assert product.has_sorted_indices


def test_entries_that_cancel_or_weigh_nothing_stay_on_the_pattern():
    matrix = csr_array(np.array([[1.0, 1.0], [1.0, -1.0], [0.0, 2.0]]))
    squared = SquaredPattern(matrix)
    product = squared.product(0, matrix.data, np.ones(3))
    assert product.nnz == 4
    np.testing.assert_array_equal(product.toarray(), [[2.0, 0.0], [0.0, 6.0]])
    np.testing.assert_array_equal(squared.product(0, matrix.data, np.zeros(3)).toarray(), np.zeros((2, 2)))
    np.testing.assert_array_equal(squared.product(0, matrix.data, np.ones(3)).toarray(), product.toarray())


def test_products_of_several_matrices_have_one_pattern_and_a_symmetric_one():
    rng = np.random.default_rng(1)
    matrices = [csr_array(random_array((30, 12), density=d, rng=rng)) for d in (0.1, 0.3, 0.05)]
    for matrix in matrices:
        matrix.sort_indices()
    squared = SquaredPattern(*matrices)
    weights = rng.uniform(-1, 1, 30)
    products = [squared.product(n, matrix.data, weights) for n, matrix in enumerate(matrices)]
    for matrix, product in zip(matrices, products, strict=True):
        full = matrix.toarray()
        np.testing.assert_allclose(product.toarray(), full.T @ (weights[:, None] * full), atol=1e-12)
        np.testing.assert_array_equal(product.toarray(), product.toarray().T)
        np.testing.assert_array_equal(product.indices, products[0].indices)
        np.testing.assert_array_equal(product.data[squared.diagonal], product.diagonal())
