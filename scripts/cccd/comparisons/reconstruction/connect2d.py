"""Connect2D: S. Ohrhallinger, S. Mudur, Computer Graphics Forum 32 (2013) 72-88.

An efficient algorithm for determining an aesthetic shape connecting unorganized 2D points.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import minimum_spanning_tree

from cccd.comparisons.links import unique_links
from cccd.comparisons.reconstruction.adjustment import adjust_boundary
from cccd.comparisons.reconstruction.delaunay import Triangulation, triangulate

__all__ = ["connect2d"]


def connect2d(points: np.ndarray) -> np.ndarray:
    """Close the minimum boundary complex into one polygon by inflating and sculpting.

    The complex is taken by the publication's greedy way: the Euclidean minimum spanning tree, then
    Delaunay edges, the shortest first, as long as one of their ends has a single link.

    Notes
    -----
    The authors' program could not be had; the order of the adjustment's steps (by change of length) is
    ours.
    """
    mesh = triangulate(points)
    if not len(mesh.triangles):
        return mesh.edges
    piece = np.zeros(len(points), np.int64)
    return unique_links(mesh.edges[adjust_boundary(mesh, _boundary_complex(mesh, len(points)), piece)])


def _boundary_complex(mesh: Triangulation, n_points: int) -> np.ndarray:
    """Edges (E,) bool of a short connected graph without leaves."""
    order = np.argsort(mesh.length, kind="stable")
    rank = np.empty(len(order))
    rank[order] = np.arange(1, len(order) + 1)  # ranks as weights: equal lengths cannot tie
    weights = coo_array((rank, tuple(mesh.edges.T)), shape=(n_points, n_points)).tocsr()
    chosen = np.zeros(len(mesh.edges), bool)
    chosen[order[minimum_spanning_tree(weights).data.astype(np.int64) - 1]] = True
    degree = np.bincount(mesh.edges[chosen].ravel(), minlength=n_points)
    for edge in order[(degree[mesh.edges[order]] < 2).any(1) & ~chosen[order]]:
        ends = mesh.edges[edge]
        if degree[ends].min() < 2:
            chosen[edge] = True
            degree[ends] += 1
    return chosen
