"""Connect2D: S. Ohrhallinger, S. Mudur, Computer Graphics Forum 32 (2013) 72-88.

An efficient algorithm for determining an aesthetic shape connecting unorganized 2D points.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import minimum_spanning_tree

from cccd_paper.comparisons.links import unique_links
from cccd_paper.comparisons.reconstruction.adjustment import adjust_boundary
from cccd_paper.comparisons.reconstruction.delaunay import Triangulation, triangulate


def connect2d(points: np.ndarray) -> np.ndarray:
    """Close the minimum boundary complex into one polygon by inflating and sculpting.

    The complex is the Euclidean minimum spanning tree and short Delaunay edges that leave no point with a
    single link. They are sought greedily, and one between two such points counts half its length.

    Notes
    -----
    The authors' program and its examples could not be had; the order of the adjustment's steps (by change of
    length) is ours. By length of the added edges alone, as in their Connect3D (in MeshLab), it closes fewer
    curves rightly. Of 60 flowers with 40 to 79 points at random places 31 come back, and 43 of 60 with 100
    to 199; a short tour brings back 49 and 52. A complex that is left open by a wide gap is what goes wrong.
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
    ends = tuple(mesh.edges.T.astype(np.int32))  # SciPy 1.15 spans no wider ones
    weights = coo_array((rank, ends), shape=(n_points, n_points)).tocsr()
    chosen = np.zeros(len(mesh.edges), bool)
    chosen[order[minimum_spanning_tree(weights).data.astype(np.int64) - 1]] = True
    degree = np.bincount(mesh.edges[chosen].ravel(), minlength=n_points)
    while (degree < 2).any():
        served = np.where(chosen, 0, (degree[mesh.edges] < 2).sum(axis=1))
        edge = int(np.argmin(np.where(served > 0, mesh.length / np.maximum(served, 1), np.inf)))
        chosen[edge] = True
        degree[mesh.edges[edge]] += 1
    return chosen
