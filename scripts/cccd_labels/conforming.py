"""Surfaces of several regions at once: a wall between two of them is one surface, used from both sides."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import csr_array, diags_array

from cccd.geometry.arrays import FloatArray, IntArray
from cccd.geometry.mesh import WIDEST_BAND, Mesh
from cccd.store import new_file, open_file, read_value, write_value

#: Arrays of a surface in its file.
_ARRAYS = ("vertices", "triangles", "regions")


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
    names: Mapping[int, str] = field(default_factory=dict[int, str])

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
        faces = np.concatenate([self.triangles[first], self.triangles[second, ::-1]])
        return Mesh(self.vertices, faces).compact()

    def wall(self, inside: int, outside: int) -> Mesh:
        """Return the wall between two regions, an open mesh counter-clockwise seen from ``outside``."""
        there = (self.regions == (inside, outside)).all(axis=1)
        back = (self.regions == (outside, inside)).all(axis=1)
        faces = np.concatenate([self.triangles[there], self.triangles[back, ::-1]])
        return Mesh(self.vertices, faces).compact()

    @cached_property
    def edges(self) -> tuple[IntArray, IntArray]:
        """Edges (E, 2), the smaller vertex first, and how many triangles (E,) meet along each."""
        a, b, c = self.triangles.T
        sides, count = ((a, b), (b, c), (c, a)), len(self.vertices)
        key = np.concatenate([np.minimum(p, q) * count + np.maximum(p, q) for p, q in sides])
        key.sort()
        first = np.flatnonzero(np.diff(key, prepend=-1))
        return np.column_stack(np.divmod(key[first], count)), np.diff(first, append=len(key))

    @property
    def junctions(self) -> IntArray:
        """Edges (E, 2) along which three walls meet, or more."""
        return self.edges[0][self.edges[1] > 2]


def write_conforming(path: str | Path, surface: ConformingSurface, report: Mapping[str, Any]) -> None:
    """Write the surfaces of a case's organs that share their walls, and what was measured on the way."""
    names = {str(label): name for label, name in surface.names.items()}
    with new_file(path) as file:
        for name in _ARRAYS:
            write_value(file, name, getattr(surface, name), FloatArray)
        write_value(file, "names", names, dict[str, str])
        write_value(file, "report", report, dict[str, Any])


def read_conforming(path: str | Path) -> ConformingSurface:
    """Read the surfaces of a case's organs that share their walls."""
    with open_file(path) as file:
        names = {int(label): name for label, name in read_value(file, "names", dict[str, str]).items()}
        return ConformingSurface(*(read_value(file, name, np.ndarray) for name in _ARRAYS), names=names)


def low_passed(surface: ConformingSurface, wave: float, degree: int) -> FloatArray:
    r"""Vertices (V, 3) without short waves, along walls and along the lines where these meet.

    Parameters
    ----------
    surface : ConformingSurface
    wave : float
        Length of the longest waves that go.
    degree : int
        Of the filter's polynomial: how sharply waves are parted.

    Notes
    -----
    A windowed sinc filter (Taubin, Zhang and Golub 1996) of the means :math:`M` over neighbours: in a wall
    all of them, on a line the two along it and the vertex itself, half and half. Of neighbours at a distance
    :math:`h`, a wave of length :math:`w` is an eigenvector of :math:`1 - M` with the value
    :math:`(\pi h / w)^2` on both. Nothing is asked across a line, so walls meet there at any angle.
    """
    means = _means_along(surface)
    start, end = surface.edges[0].T
    square = float(np.mean(sum((along[start] - along[end]) ** 2 for along in surface.vertices.T)))
    band = min(np.pi**2 * square / max(wave, 1e-9) ** 2, WIDEST_BAND)
    middle = surface.vertices.mean(axis=0)
    before, now = surface.vertices - middle, surface.vertices - middle
    weights = _sinc_weights(band, degree)
    now = (before + means @ before) / 2
    total = weights[0] * before + weights[1] * now
    for weight in weights[2:]:  # Chebyshev polynomials of (1 + M) / 2
        before, now = now, now + means @ now - before
        total += weight * now
    return total + middle


def _sinc_weights(band: float, degree: int) -> FloatArray:
    """Weights of Chebyshev polynomials that let pass what lies below a band of 0 to 2; constants stay."""
    n = np.arange(1, degree + 1)
    window = 0.54 + 0.46 * np.cos(np.pi * n / (degree + 1))
    angle = np.arccos(1 - band / 2)

    def weights(shift: float) -> FloatArray:
        rest = 2 * window * np.sin(n * (angle + shift)) / (np.pi * n)
        return np.concatenate([[(angle + shift) / np.pi], rest])

    # the window blurs the edge of the band; it moves out until the longest waves keep their height
    low, high = 0.0, 2.0 * np.pi / (degree + 1)
    for _ in range(40):
        middle = (low + high) / 2
        at_band = float(weights(middle) @ np.cos(np.arange(degree + 1) * angle))
        low, high = (low, middle) if at_band > 1 else (middle, high)
    found = weights(low)
    return found / found.sum()


def _means_along(surface: ConformingSurface) -> csr_array:
    """Matrix (V, V) of means of neighbours: in walls of all, on lines of those along it and of the vertex."""
    count = len(surface.vertices)
    edges, lines = (pairs.astype(np.int32) for pairs in (surface.edges[0], surface.junctions))
    on_line = np.bincount(lines.ravel(), minlength=count)
    links = [pairs[on_line[pairs[:, 0]] == 0] for pairs in (edges, edges[:, ::-1])]
    links += [pairs[on_line[pairs[:, 0]] > 1] for pairs in (lines, lines[:, ::-1])]
    rows, columns = np.concatenate(links).T
    degree = np.bincount(rows, minlength=count)
    own = np.where(degree == 0, 1.0, np.where(on_line > 1, 0.5, 0.0))
    share = (1 - own) / np.maximum(degree, 1)
    return csr_array(csr_array((share[rows], (rows, columns)), shape=(count, count)) + diags_array(own))
