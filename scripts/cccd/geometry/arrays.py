"""Types of arrays, and ragged arrays: parts of different length that stand in one array.

A ragged array of C parts is an array whose first axis runs through all parts one after the other, and
``offsets`` (C + 1,): part ``c`` is ``values[offsets[c]:offsets[c + 1]]``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeAlias, TypeVar

import numpy as np
import numpy.typing as npt
import scipy

from cccd.tolerances import TINY

FloatArray: TypeAlias = npt.NDArray[np.float64]
SingleArray: TypeAlias = npt.NDArray[np.float32]
IntArray: TypeAlias = npt.NDArray[np.int64]
ByteArray: TypeAlias = npt.NDArray[np.uint8]
#: Numbers of regions, many at a time.
LabelArray: TypeAlias = npt.NDArray[np.integer[Any]]
BoolArray: TypeAlias = npt.NDArray[np.bool_]
#: Whole or floating-point numbers of any size.
RealArray: TypeAlias = npt.NDArray[np.integer[Any] | np.floating[Any]]
AnyArray: TypeAlias = npt.NDArray[Any]

_Scalar = TypeVar("_Scalar", bound=np.generic)


def unit_vectors(vectors: FloatArray) -> FloatArray:
    """Vectors (..., 3) of unit length; those of no length stay so."""
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), TINY)


def connected_parts(first: IntArray, second: IntArray, count: int) -> IntArray:
    """Give each of ``count`` nodes the number, from 0, of the connected part that edges (E,) put it in."""
    links = scipy.sparse.coo_array((np.ones(len(first), bool), (first, second)), shape=(count, count))
    return np.asarray(scipy.sparse.csgraph.connected_components(links, directed=False)[1], np.int64)


def distinct(numbers: AnyArray) -> tuple[IntArray, IntArray]:
    """Distinct whole numbers (N,), ascending, and the place of each element (...) among them."""
    if numbers.size == 0 or int(numbers.max()) - int(numbers.min()) > 8 * numbers.size:  # spread
        found, place = np.unique(numbers, return_inverse=True)
        return found, place.reshape(numbers.shape)
    low = int(numbers.min())
    above = numbers.astype(np.int64) - low  # to mark them takes a tenth of the time of sorting
    there = np.zeros(int(above.max()) + 1, np.bool_)
    there[above] = True
    return np.flatnonzero(there) + low, (np.cumsum(there) - 1)[above]


def offsets_of(counts: npt.ArrayLike) -> IntArray:
    """Offsets (C + 1,) of parts with ``counts`` (C,) members.

    Examples
    --------
    >>> offsets_of([2, 0, 3]).tolist()
    [0, 2, 2, 5]
    """
    counts = np.asarray(counts)
    offsets = np.zeros(len(counts) + 1, np.int64)
    np.cumsum(counts, out=offsets[1:])
    return offsets


def owners_of(offsets: IntArray) -> IntArray:
    """Part (P,) that each member belongs to.

    Examples
    --------
    >>> owners_of(np.array([0, 2, 2, 5])).tolist()
    [0, 0, 2, 2, 2]
    """
    return np.repeat(np.arange(len(offsets) - 1), np.diff(offsets))


def ranks_of(counts: npt.ArrayLike) -> IntArray:
    """Position (P,) of each member within its own part, for parts with ``counts`` (C,) members.

    Examples
    --------
    >>> ranks_of([2, 0, 3]).tolist()
    [0, 1, 0, 1, 2]
    """
    counts = np.asarray(counts, np.int64)
    return np.arange(int(counts.sum())) - np.repeat(np.cumsum(counts) - counts, counts)


def concatenate_ragged(parts: Sequence[AnyArray], dim: int = 2) -> tuple[AnyArray, IntArray]:
    """Stack arrays of ``(n_c, dim)`` into ``(P, dim)`` and the offsets ``(C + 1,)`` that split them."""
    offsets = offsets_of([len(part) for part in parts])
    points = np.concatenate(parts) if len(parts) else np.zeros((0, dim))
    return np.ascontiguousarray(points), offsets


def split_ragged(values: npt.NDArray[_Scalar], offsets: IntArray) -> list[npt.NDArray[_Scalar]]:
    """Split an array (P, ...) into its C parts: undoes `concatenate_ragged`."""
    return np.split(values, offsets[1:-1])[: len(offsets) - 1]  # split gives one part of nothing


def successors(offsets: IntArray) -> IntArray:
    """Index (P,) of each member's successor on its closed part: the last is followed by the first.

    Examples
    --------
    >>> successors(np.array([0, 3, 5])).tolist()
    [1, 2, 0, 4, 3]
    """
    following = np.arange(1, int(offsets[-1]) + 1)
    filled = offsets[1:] > offsets[:-1]
    following[offsets[1:][filled] - 1] = offsets[:-1][filled]
    return following


def predecessors(offsets: IntArray) -> IntArray:
    """Index (P,) of each member's predecessor on its closed part."""
    preceding = np.arange(-1, int(offsets[-1]) - 1)
    filled = offsets[1:] > offsets[:-1]
    preceding[offsets[:-1][filled]] = offsets[1:][filled] - 1
    return preceding


def sum_per_part(values: RealArray | BoolArray, offsets: IntArray) -> FloatArray:
    """Sum (C,) of the values (P,) of each part.

    Examples
    --------
    >>> sum_per_part(np.array([1.0, 2, 4]), np.array([0, 1, 1, 3])).tolist()
    [1.0, 0.0, 6.0]
    """
    total = np.concatenate([[0.0], np.cumsum(values)])
    return total[offsets[1:]] - total[offsets[:-1]]
