"""Surfaces of several regions at once: a wall between two of them is one surface, used from both sides."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array, diags_array
from scipy.sparse.linalg import LinearOperator, cg

from cccd.geometry.arrays import BoolArray, FloatArray, IntArray
from cccd.geometry.averaging import averages
from cccd.geometry.mesh import Mesh

__all__ = ["ConformingSurface", "faired"]


def _no_names() -> dict[int, str]:
    return {}


@dataclass(frozen=True, eq=False)
class ConformingSurface:
    """Triangles between regions, each of which has one region on either side.

    Attributes
    ----------
    vertices : (V, 3) float64
        Mostly in world mm (RAS).
    triangles : (T, 3) int64
        Counter-clockwise seen from the second of their regions.
    regions : (T, 2) int64
        Labels of the region that a triangle's normal leaves and of the one that it enters; 0 is outside.
    names : mapping of int to str
        What the labels are called.

    Examples
    --------
    Two tetrahedra on one triangle:

    >>> points = np.array([(0.0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0, -1)])
    >>> triangles = np.array([(0, 1, 2), (0, 1, 3), (1, 2, 3), (0, 3, 2), (0, 2, 4), (0, 4, 1), (1, 4, 2)])
    >>> regions = np.array([(2, 1), (1, 0), (1, 0), (1, 0), (2, 0), (2, 0), (2, 0)])
    >>> both = ConformingSurface(points, triangles, regions)
    >>> both.labels, both.pairs, [round(6 * both.mesh_of(label).volume, 9) for label in both.labels]
    ([1, 2], [(0, 1), (0, 2), (1, 2)], [1.0, 1.0])
    """

    vertices: FloatArray
    triangles: IntArray
    regions: IntArray
    names: Mapping[int, str] = field(default_factory=_no_names)

    @property
    def labels(self) -> list[int]:
        """Labels of the regions that have triangles, ascending, without 0."""
        return [int(label) for label in np.unique(self.regions) if label]

    @cached_property
    def pairs(self) -> list[tuple[int, int]]:
        """Pairs of labels, the smaller first, that have a wall between them; (0, label) is the outside's."""
        found = np.unique(np.sort(self.regions, axis=1), axis=0)
        return [(int(low), int(high)) for low, high in found]

    def mesh_of(self, label: int) -> Mesh:
        """Return the closed mesh of a region, oriented outwards; neighbours have the very same vertices."""
        first, second = self.regions[:, 0] == label, self.regions[:, 1] == label
        return self._part(np.concatenate([self.triangles[first], self.triangles[second, ::-1]]))

    def wall(self, inside: int, outside: int) -> Mesh:
        """Return the wall between two regions, an open mesh counter-clockwise seen from ``outside``."""
        there = (self.regions == (inside, outside)).all(axis=1)
        back = (self.regions == (outside, inside)).all(axis=1)
        return self._part(np.concatenate([self.triangles[there], self.triangles[back, ::-1]]))

    @cached_property
    def edges(self) -> tuple[IntArray, IntArray]:
        """Edges (E, 2), the smaller vertex first, and how many triangles (E,) meet along each."""
        triangles = self.triangles
        sides = np.sort(np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
        key, count = np.unique(sides[:, 0] * len(self.vertices) + sides[:, 1], return_counts=True)
        return np.column_stack(np.divmod(key, len(self.vertices))), count

    @property
    def junctions(self) -> IntArray:
        """Edges (E, 2) along which three walls meet, or more."""
        edges, count = self.edges
        return edges[count > 2]

    @property
    def on_junctions(self) -> BoolArray:
        """Vertices (V,) along these."""
        return np.bincount(self.junctions.ravel(), minlength=len(self.vertices)) > 0

    def averages(self, values: FloatArray, rounds: Sequence[int]) -> list[FloatArray]:
        """Average values (V,) along walls, but not into or across lines where walls meet; there they stay.

        See `cccd.geometry.averaging.averages`.
        """
        return averages(self._means, values, rounds)

    @cached_property
    def _means(self) -> csr_array:
        """Matrix (V, V) of the mean of each vertex's neighbours, but for lines where walls meet."""
        edges = self.edges[0][~self.on_junctions[self.edges[0]].any(axis=1)]
        starts, ends = np.concatenate([edges, edges[:, ::-1]]).T
        count = len(self.vertices)
        degree = np.bincount(starts, minlength=count)
        alone = np.flatnonzero(degree == 0)
        weights = np.concatenate([1 / degree[starts], np.ones(len(alone))])
        rows, columns = (np.concatenate([side, alone]) for side in (starts, ends))
        return csr_array((weights, (rows, columns)), shape=(count, count))

    def _part(self, faces: IntArray) -> Mesh:
        return Mesh(self.vertices, faces).compact()


def faired(
    surface: ConformingSurface, trust: FloatArray, stiffness: FloatArray, rounds: int = 200
) -> FloatArray:
    r"""Vertices (V, 3) of smooth walls that meet along smooth lines.

    They minimise :math:`\sum t |x - x_0|^2 + \sum s |x - \bar x|^2`, the second term being the distance of
    each vertex to the mean of its neighbours (a thin plate's energy): of all neighbours within a wall, of the
    two neighbours along the line where three walls meet. Walls go on straight to their lines, whatever the
    angles between them, because nothing is asked across a line.

    Parameters
    ----------
    surface : ConformingSurface
    trust : (V,) float64
        The t of each vertex; above 0.
    stiffness : (V,) float64
        The s of each vertex; waves whose length is :math:`\pi s^{1/4}` edges or so are halved where t is 1.
    rounds : int
        Steps of conjugate gradients at most.
    """
    bending, shape = _bending(surface), surface.vertices.shape
    back, trust = csr_array(bending.T), trust[:, None]
    diagonal = trust + (bending.power(2).T @ stiffness)[:, None]

    def matrix(x: FloatArray) -> FloatArray:  # of all three coordinates at once; its entries are never made
        x = x.reshape(shape)
        return (trust * x + back @ (stiffness[:, None] * (bending @ x))).ravel()

    size = (surface.vertices.size,) * 2
    whole = LinearOperator(size, matvec=matrix, dtype=np.float64)
    scale = LinearOperator(size, matvec=lambda x: (x.reshape(shape) / diagonal).ravel(), dtype=np.float64)
    right, begin = (trust * surface.vertices).ravel(), surface.vertices.ravel()
    smooth, _ = cg(whole, right, begin, rtol=1e-6, maxiter=rounds, M=scale)
    return smooth.reshape(shape)


def _bending(surface: ConformingSurface) -> csr_array:
    """Matrix (V, V) of vertices less the mean of their neighbours; 0 where junction lines end or meet."""
    count = len(surface.vertices)
    edges, lines = surface.edges[0], surface.junctions
    on_line = np.bincount(lines.ravel(), minlength=count)
    within = np.concatenate([edges, edges[:, ::-1]])
    along = np.concatenate([lines, lines[:, ::-1]])
    links = np.concatenate([within[on_line[within[:, 0]] == 0], along[on_line[along[:, 0]] == 2]])
    degree = np.bincount(links[:, 0], minlength=count)
    means = csr_array((-1 / degree[links[:, 0]], (links[:, 0], links[:, 1])), shape=(count, count))
    return csr_array(means + diags_array((degree > 0).astype(float)))
