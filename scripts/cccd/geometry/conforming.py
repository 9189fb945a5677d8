"""Surfaces of several regions at once: a wall between two of them is one surface, used from both sides."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from cccd.geometry.arrays import FloatArray, IntArray
from cccd.geometry.mesh import Mesh

__all__ = ["ConformingSurface"]


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

    def _part(self, faces: IntArray) -> Mesh:
        used, inverse = np.unique(faces, return_inverse=True)
        return Mesh(self.vertices[used], inverse.reshape(-1, 3).astype(np.int64))
