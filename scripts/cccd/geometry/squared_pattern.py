"""Products of a sparse matrix, weighted, with its own transpose, for many values on one pattern."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array

from cccd.geometry._jit import jit
from cccd.geometry.arrays import AnyArray, FloatArray

__all__ = ["SquaredPattern"]


class SquaredPattern:
    """Where the entries of :math:`A^T W A` are, found once for all matrices A with the same pattern.

    Parameters
    ----------
    matrix : (P, V) sparse
        In canonical form; its values do not matter.

    Examples
    --------
    >>> matrix = csr_array(np.array([(1.0, 2, 0), (0, 3, 4)]))
    >>> SquaredPattern(matrix).product(matrix.data, np.array([1.0, 10])).toarray()
    array([[  1.,   2.,   0.],
           [  2.,  94., 120.],
           [  0., 120., 160.]])
    """

    def __init__(self, matrix: csr_array) -> None:
        self.rows, self.columns = matrix.indptr, matrix.indices
        numbered = csr_array((np.arange(matrix.nnz), matrix.indices, matrix.indptr), shape=matrix.shape)
        self.transposed = csr_array(numbered.T)
        there = csr_array((np.ones(matrix.nnz, np.int8), matrix.indices, matrix.indptr), shape=matrix.shape)
        self.squared = csr_array(there.T @ there)
        self.squared.sort_indices()

    def product(self, data: FloatArray, weights: FloatArray) -> csr_array:
        """Multiply.

        Parameters
        ----------
        data : (N,) float64
            The matrix's entries.
        weights : (P,) float64
            Of its rows.

        Returns
        -------
        (V, V) sparse
            With sorted columns; every entry is added up in the order of the matrix's rows.
        """
        weighted = data * np.repeat(weights, np.diff(self.rows))
        there, squared = self.transposed, self.squared
        values, total = np.empty(squared.nnz), np.zeros(squared.shape[1])
        _write_values(
            (self.rows, self.columns, weighted),
            (there.indptr, there.indices, data[there.data]),
            (squared.indptr, squared.indices),
            values,
            total,
        )
        return csr_array((values, squared.indices, squared.indptr), shape=squared.shape)


@jit
def _write_values(
    right: tuple[AnyArray, AnyArray, FloatArray],
    left: tuple[AnyArray, AnyArray, FloatArray],
    there: tuple[AnyArray, AnyArray],
    values: FloatArray,
    total: FloatArray,
) -> None:
    """Write the values of a product of two sparse matrices: starts of rows, columns, values, where they are.

    ``total`` has a zero for each column.
    """
    starts, columns = there
    for i in range(len(starts) - 1):
        for n in range(left[0][i], left[0][i + 1]):
            row, factor = left[1][n], left[2][n]
            for m in range(right[0][row], right[0][row + 1]):
                total[right[1][m]] += factor * right[2][m]
        for n in range(starts[i], starts[i + 1]):
            values[n] = total[columns[n]]
            total[columns[n]] = 0.0
