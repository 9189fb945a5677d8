"""Peel: A. D. Parakkat, S. Methirumangalath, R. Muthuganapathy, Peeling the longest.

Computers & Graphics 74 (2018) 191-201.
"""

from __future__ import annotations

import numpy as np

from cccd_paper.comparisons.links import unique_links
from cccd_paper.comparisons.reconstruction.delaunay import triangulate


def peel(points: np.ndarray) -> np.ndarray:
    """Remove the longest edge of every Delaunay triangle, then all but the two shortest at each point."""
    mesh = triangulate(points)
    rank = np.empty(len(mesh.edges), np.int64)
    rank[np.argsort(mesh.length, kind="stable")] = np.arange(len(mesh.edges))
    sides = rank[mesh.triangle_edges]
    kept = np.ones(len(mesh.edges), bool)
    kept[mesh.triangle_edges[np.arange(len(sides)), sides.argmax(1)]] = False

    start, _, edge, _ = mesh.directed()
    start, edge = start[kept[edge]], edge[kept[edge]]
    place = np.arange(len(start)) - np.searchsorted(start, start)
    return unique_links(mesh.edges[np.setdiff1d(edge, edge[place >= 2])])
