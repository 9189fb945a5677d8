"""The Delaunay triangulation with its edges: what every reconstruction from points starts from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import Delaunay, QhullError


@dataclass(frozen=True)
class Triangulation:
    """Triangles and unique edges of a planar point set.

    Attributes
    ----------
    points : (N, 2) float64
    triangles : (T, 3) int64
        Point numbers.
    edges : (E, 2) int64
        Each ascending, in lexicographic order.
    length : (E,) float64
    triangle_edges : (T, 3) int64
        ``triangle_edges[t, c]`` is the edge opposite to corner c of triangle t.
    edge_triangles : (E, 2) int64
        The one or two triangles at an edge, -1 outside the hull (in the second column).
    """

    points: np.ndarray
    triangles: np.ndarray
    edges: np.ndarray
    length: np.ndarray
    triangle_edges: np.ndarray
    edge_triangles: np.ndarray

    def directed(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Both directions of every edge, the shortest first at each start.

        Returns
        -------
        start, end, edge : (2 E,) int64
        length : (2 E,) float64
        """
        start, end = np.concatenate([self.edges, self.edges[:, ::-1]]).T
        edge = np.tile(np.arange(len(self.edges)), 2)
        order = np.lexsort((end, self.length[edge], start))
        return start[order], end[order], edge[order], self.length[edge][order]


def triangulate(points: np.ndarray) -> Triangulation:
    """Triangulate points (N, 2); points on one line give the links along it and no triangle."""
    points = np.ascontiguousarray(points, float)
    try:
        triangles = Delaunay(points).simplices.astype(np.int64) if len(points) > 2 else np.zeros((0, 3), int)
    except QhullError:  # all on one line
        triangles = np.zeros((0, 3), np.int64)
    if not len(triangles):
        along = np.lexsort(points.T[::-1])
        edges = np.sort(np.column_stack([along[:-1], along[1:]]), axis=1)
        edges = edges[np.lexsort(edges.T[::-1])]
        triangle_edges = np.zeros((0, 3), np.int64)
        edge_triangles = np.full((len(edges), 2), -1)
    else:
        sides = np.sort(triangles[:, [[1, 2], [2, 0], [0, 1]]].reshape(-1, 2), axis=1)
        edges, inverse = np.unique(sides, axis=0, return_inverse=True)
        inverse = inverse.ravel()
        triangle_edges = inverse.reshape(-1, 3)
        order = np.argsort(inverse, kind="stable")
        owner, beginning = order // 3, np.searchsorted(inverse[order], np.arange(len(edges)))
        shared = np.bincount(inverse) == 2
        edge_triangles = np.full((len(edges), 2), -1)
        edge_triangles[:, 0] = owner[beginning]
        edge_triangles[shared, 1] = owner[beginning[shared] + 1]
    length = np.linalg.norm(points[edges[:, 0]] - points[edges[:, 1]], axis=1)
    return Triangulation(points, triangles, edges, length, triangle_edges, edge_triangles)


def first_of_each(group: np.ndarray) -> np.ndarray:
    """Positions at which each run of equal values in a sorted array (M,) begins."""
    return np.flatnonzero(np.r_[True, group[1:] != group[:-1]]) if len(group) else np.zeros(0, np.int64)
