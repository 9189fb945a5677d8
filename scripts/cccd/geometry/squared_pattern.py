"""Products of sparse matrices, weighted, with their own transposes, for many values on one pattern."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array

from cccd.geometry._jit import jit
from cccd.geometry.arrays import AnyArray, FloatArray, IntArray

__all__ = ["SquaredPattern"]


class SquaredPattern:
    """Where the entries of :math:`A^T W A` are, found once for some matrices A and all values of theirs.

    Parameters
    ----------
    *matrices : (P, V) sparse
        With sorted columns, each once; their values do not matter.

    Attributes
    ----------
    diagonal : (V,) int64
        Where in the products' values the diagonal is; for columns that have entries.

    Examples
    --------
    >>> matrix = csr_array(np.array([(1.0, 2, 0), (0, 3, 4)]))
    >>> SquaredPattern(matrix).product(0, matrix.data, np.array([1.0, 10])).toarray()
    array([[  1.,   2.,   0.],
           [  2.,  94., 120.],
           [  0., 120., 160.]])
    """

    def __init__(self, *matrices: csr_array) -> None:
        self._parts = [(matrix.indptr, matrix.indices, _numbered(matrix)) for matrix in matrices]
        there = _ones(matrices[0])
        for matrix in matrices[1:]:
            there = csr_array(there + _ones(matrix))
        there.data[:] = 1
        self._squared = csr_array(there.T @ there)
        self._squared.sort_indices()
        columns = np.repeat(np.arange(there.shape[1]), np.diff(self._squared.indptr))
        self.diagonal: IntArray = np.flatnonzero(columns == self._squared.indices)

    def product(self, number: int, data: FloatArray, weights: FloatArray) -> csr_array:
        """Multiply one of the matrices with its transpose.

        Parameters
        ----------
        number : int
            Which of them.
        data : (N,) float64
            Its entries.
        weights : (P,) float64
            Of its rows.

        Returns
        -------
        (V, V) sparse
            Symmetric, with sorted columns and the entries of all products; each is added up in the order of
            the matrix's rows.
        """
        rows, columns, there = self._parts[number]
        squared = self._squared
        weighted = data * np.repeat(weights, np.diff(rows))
        values, room = np.empty(squared.nnz), np.zeros(squared.shape[1])
        _write_values(
            (rows, columns, data, weighted),
            (there.indptr, there.indices, there.data),
            (squared.indptr, squared.indices),
            values,
            room,
            np.full(squared.shape[1], -1),
        )
        return csr_array((values, squared.indices, squared.indptr), shape=squared.shape)


def _numbered(matrix: csr_array) -> csr_array:
    """Transpose of a matrix with the entries' numbers for values."""
    numbers = csr_array((np.arange(matrix.nnz), matrix.indices, matrix.indptr), shape=matrix.shape)
    return csr_array(numbers.T)


def _ones(matrix: csr_array) -> csr_array:
    ones = np.ones(matrix.nnz, np.int8)
    return csr_array((ones, matrix.indices, matrix.indptr), shape=matrix.shape)


@jit
def _write_values(
    matrix: tuple[AnyArray, AnyArray, FloatArray, FloatArray],
    transposed: tuple[AnyArray, AnyArray, AnyArray],
    squared: tuple[AnyArray, AnyArray],
    values: FloatArray,
    total: FloatArray,
    mirrored: IntArray,
) -> None:
    """Write the values of a product, of which half is computed: starts of rows, columns, values.

    ``total`` has a zero for each column, ``mirrored`` -1: which entry of that row is next taken for one below
    the diagonal.
    """
    rows, columns, data, weighted = matrix
    starts, places = squared
    for i in range(len(starts) - 1):
        for n in range(transposed[0][i], transposed[0][i + 1]):
            entry = transposed[2][n]
            for m in range(entry, rows[transposed[1][n] + 1]):
                total[columns[m]] += data[entry] * weighted[m]
        for n in range(starts[i], starts[i + 1]):
            j = places[n]
            if j < i:
                values[n] = values[mirrored[j]]
                mirrored[j] += 1
                continue
            if mirrored[i] < 0:
                mirrored[i] = n + 1 if j == i else n
            values[n] = total[j]
            total[j] = 0.0
