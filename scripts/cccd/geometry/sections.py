"""Cross-sections of a mesh: the closed loops in which it meets parallel planes."""

from __future__ import annotations

import numpy as np

from cccd.geometry.arrays import FloatArray, IntArray
from cccd.geometry.mesh import Mesh


def cross_sections(mesh: Mesh, normal: FloatArray, heights: FloatArray) -> list[list[FloatArray]]:
    """Cut a closed mesh by parallel planes.

    Parameters
    ----------
    mesh : Mesh
        Closed, consistently oriented.
    normal : (3,) float64
        Unit normal of the planes.
    heights : (P,) float64
        Planes ``x @ normal == height``.

    Returns
    -------
    list of list of (n, 3) float64
        For each plane its closed loops, the first point not repeated. A plane through vertices counts them
        as above it, so that every loop closes.
    """
    level = mesh.vertices @ np.asarray(normal, float)
    lows, highs = level[mesh.faces].min(axis=1), level[mesh.faces].max(axis=1)
    return [
        _loops(mesh.vertices, mesh.faces[(lows < height) & (highs >= height)], level - height)
        for height in np.asarray(heights, float)
    ]


def _loops(vertices: FloatArray, triangles: IntArray, height: FloatArray) -> list[FloatArray]:
    """Loops in which triangles meet the plane above which their vertices are by ``height`` (V,)."""
    above = height[triangles] >= 0
    # the edge along which an oriented triangle rises through the plane, and the one where it sinks;
    # the neighbour across an edge goes along it the other way
    ahead = np.roll(above, -1, axis=1)
    rising, sinking = (~above & ahead).argmax(axis=1), (above & ~ahead).argmax(axis=1)
    rows = np.arange(len(triangles))
    rise = np.column_stack([triangles[rows, rising], triangles[rows, (rising + 1) % 3]])
    sink = np.column_stack([triangles[rows, (sinking + 1) % 3], triangles[rows, sinking]])
    edges, ids = np.unique(np.concatenate([rise, sink]), axis=0, return_inverse=True)
    successor = np.empty(len(edges), np.int64)
    risen, sunk = ids.reshape(2, -1)
    successor[risen] = sunk
    below, over = height[edges[:, 0]], height[edges[:, 1]]
    share = (-below / (over - below))[:, None]
    points = vertices[edges[:, 0]] * (1 - share) + vertices[edges[:, 1]] * share
    return [points[cycle] for cycle in _cycles(successor)]


def _cycles(successor: IntArray) -> list[list[int]]:
    """Cycles of a permutation, each from its lowest member on."""
    following: list[int] = successor.tolist()
    visited = [False] * len(following)
    cycles: list[list[int]] = []
    for start in range(len(following)):
        cycle: list[int] = []
        item = start
        while not visited[item]:
            visited[item] = True
            cycle.append(item)
            item = following[item]
        if cycle:
            cycles.append(cycle)
    return cycles
