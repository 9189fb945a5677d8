"""Closed curves of the plane: polygons, many in one array, and cubic B-splines.

The polygons' layout is that of shapely's ragged arrays: all points one after the other, and offsets that say
where each polygon begins. `RaggedPolygons` works on all of them at once.

A closed spline with n control points has n spans. Span ``s`` lies between the knots ``t[s + 3]`` and
``t[s + 4]`` and is ruled by the control points ``s .. s + 3`` (mod n). The knots are n + 7, as SciPy wants
them for the control points with the first three repeated at the end. Fits use `cccd.curves.periodic`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from cccd.geometry.arrays import (
    AnyArray,
    BoolArray,
    FloatArray,
    IntArray,
    concatenate_ragged,
    offsets_of,
    owners_of,
    predecessors,
    ranks_of,
    split_ragged,
    successors,
    sum_per_part,
)


@dataclass(frozen=True, eq=False)
class RaggedPolygons:
    """Closed polygons, ragged; the first point is not repeated.

    Attributes
    ----------
    points : (P, 2) float64
        Points (i, j) of all polygons, one polygon after the other.
    offsets : (C + 1,) int64
        Polygon ``c`` is ``points[offsets[c]:offsets[c + 1]]``; it may be empty.

    Examples
    --------
    >>> square = np.array([(0.0, 0), (2, 0), (2, 2), (0, 2)])
    >>> polygons = RaggedPolygons.of([square, square[::-1] / 2])
    >>> polygons.signed_areas.tolist(), polygons.lengths.tolist()
    ([4.0, -1.0], [8.0, 4.0])
    """

    points: FloatArray
    offsets: IntArray

    @classmethod
    def of(cls, polygons: Sequence[AnyArray]) -> RaggedPolygons:
        """Put polygons (n_c, 2) one after the other."""
        return cls(*concatenate_ragged(polygons))

    def __len__(self) -> int:
        return len(self.offsets) - 1

    def __iter__(self) -> Iterator[FloatArray]:
        return iter(split_ragged(self.points, self.offsets))

    @property
    def sizes(self) -> IntArray:
        """Number of points (C,) of each polygon."""
        return np.diff(self.offsets)

    @property
    def owners(self) -> IntArray:
        """Polygon (P,) that each point belongs to."""
        return owners_of(self.offsets)

    @property
    def successors(self) -> IntArray:
        """Index (P,) of the point that follows each point on its polygon."""
        return successors(self.offsets)

    @property
    def predecessors(self) -> IntArray:
        """Index (P,) of the point that comes before each point on its polygon."""
        return predecessors(self.offsets)

    @property
    def steps(self) -> FloatArray:
        """Vectors (P, 2) from each point to its successor."""
        return self.points[self.successors] - self.points

    @property
    def signed_areas(self) -> FloatArray:
        """Shoelace areas (C,): positive where a polygon turns from +i to +j (counter-clockwise)."""
        if len(self.points) == 0:
            return np.zeros(len(self))
        # coordinates relative to each polygon's first point keep the products small and exact
        first = self.points[np.minimum(self.offsets[:-1], len(self.points) - 1)]
        local = self.points - np.repeat(first, self.sizes, axis=0)
        following = local[self.successors]
        twice = local[:, 0] * following[:, 1] - local[:, 1] * following[:, 0]
        return sum_per_part(twice, self.offsets) / 2

    @property
    def lengths(self) -> FloatArray:
        """Lengths (C,) all the way around."""
        return sum_per_part(np.linalg.norm(self.steps, axis=1), self.offsets)

    @property
    def is_simple(self) -> BoolArray:
        """Whether each polygon (C,) is strictly simple: it never touches or crosses itself."""
        sizes = self.sizes
        simple = np.zeros(len(self), bool)
        filled = np.flatnonzero(sizes >= 3)
        if len(filled):
            simple[filled] = shapely.is_simple(self.take(filled).rings())
            # shapely overlooks a point repeated in place, which moves nothing but is a vertex twice
            still = (self.points[self.successors] == self.points).all(axis=1)
            simple &= sum_per_part(still, self.offsets) == 0
        return simple

    def rings(self) -> AnyArray:
        """Polygons as ``shapely.LinearRing`` (C,); each needs at least three points."""
        return np.asarray(shapely.linearrings(self.points, indices=self.owners))

    def take(self, chosen: IntArray | BoolArray) -> RaggedPolygons:
        """Polygons of the given numbers, or those that are marked."""
        index = np.arange(len(self))[chosen]
        counts = self.sizes[index]
        members = np.repeat(self.offsets[index], counts) + ranks_of(counts)
        return RaggedPolygons(self.points[members], offsets_of(counts))

    def resample(self, counts: IntArray) -> RaggedPolygons:
        """Points evenly spaced by arc length.

        Parameters
        ----------
        counts : (C,) int array
            How many points each polygon shall have; the first one stays.
        """
        closed = self.offsets + np.arange(len(self.offsets))  # with its first point repeated at its end
        ring = np.empty((len(self.points) + len(self), 2))
        last = np.zeros(len(ring), bool)
        last[closed[1:] - 1] = True
        ring[~last] = self.points
        ring[last] = self.points[self.offsets[:-1]]
        length = np.zeros(len(ring))
        length[1:] = np.hypot(*np.diff(ring, axis=0).T)
        length[closed[1:-1]] = 1.0  # separates the polygons on one common axis
        position = np.cumsum(length)
        begin, end = position[closed[:-1]], position[closed[1:] - 1]
        wanted = np.repeat(begin, counts)
        wanted += ranks_of(counts) * np.repeat((end - begin) / np.maximum(counts, 1), counts)
        columns = [np.interp(wanted, position, ring[:, axis]) for axis in (0, 1)]
        return RaggedPolygons(np.column_stack(columns), offsets_of(counts))


#: Cubic throughout (equations 6-9).
DEGREE = 3


def extend_knots(breaks: FloatArray, period: float) -> FloatArray:
    """Knots (n + 7,) of a closed cubic spline from its n breaks, ascending in ``[0, period)``."""
    turn, index = np.divmod(np.arange(-DEGREE, len(breaks) + DEGREE + 1), len(breaks))
    return breaks[index] + turn * period


def evaluate_spline(knots: FloatArray, control: FloatArray, parameters: FloatArray) -> FloatArray:
    """Points (m, 2) at parameters within the base period, by de Boor's algorithm for all of them at once."""
    span = np.minimum(np.searchsorted(knots[DEGREE:], parameters, side="right"), len(control)) - 1
    past = parameters - knots[span + np.arange(2 * DEGREE + 1)[:, None]]
    points = [control.T[:, (span + r) % len(control)] for r in range(DEGREE + 1)]
    for level in range(1, DEGREE + 1):
        for r in range(DEGREE, level - 1, -1):
            share = past[r] / (past[r] - past[r + DEGREE + 1 - level])
            points[r] = points[r - 1] + share * (points[r] - points[r - 1])
    return points[DEGREE].T
