"""Tubes as one solid on a grid: what is solid joined, cavities taken away, what floats inside them added.

Signed distances need no mesh booleans: of a union they are the smallest of its parts'.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cccd.geometry.arrays import FloatArray, IntArray, SingleArray
from cccd.geometry.distance import grid_to_mesh
from cccd.geometry.grid import ScalarGrid
from cccd.geometry.mesh import Mesh
from cccd.surface.booleans import Nested

__all__ = ["BAND_CELLS", "unite_on_grid"]

#: Distances are kept up to this many cells to either side of the surface.
BAND_CELLS = 1.5
#: Walls that both run within this many cells of a node meet there: along a line, some node is always as near.
MEETING_CELLS = 0.75


def unite_on_grid(
    meshes: Sequence[Mesh], tubes: Sequence[Nested], cell: float
) -> tuple[ScalarGrid, FloatArray]:
    """Sample the signed distance to tubes that are joined and taken away as they nest.

    Parameters
    ----------
    meshes : sequence of Mesh
        Closed, oriented outwards, one of each tube.
    tubes : sequence of Nested
    cell : float
        mm between the grid's nodes.

    Returns
    -------
    grid : ScalarGrid
        float32, mm, negative inside, cut off some cells away from the surface.
    seams : (P, 3) float64
        Nodes on the surface near which walls of two tubes meet.
    """
    solid = [mesh for mesh, tube in zip(meshes, tubes, strict=True) if not tube.hole]
    low = np.min([mesh.vertices.min(axis=0) for mesh in solid], axis=0) - (3 + 1 / np.pi) * cell
    high = np.max([mesh.vertices.max(axis=0) for mesh in solid], axis=0)
    shape = np.ceil((high - low) / cell).astype(np.int64) + 3
    limit = np.float32(BAND_CELLS * cell)
    values, wall, meeting = np.full(shape, limit), np.full(shape, limit), np.zeros(shape, bool)
    near = np.float32(MEETING_CELLS * cell)
    for n in sorted(range(len(tubes)), key=lambda n: (tubes[n].depth, tubes[n].hole)):
        window = _window(meshes[n], low, cell, shape)
        if any(side.start >= side.stop for side in window):
            continue
        distance = _distance(meshes[n], low, cell, window)
        away = np.abs(distance)
        meeting[window] |= (away < near) & (wall[window] < near)
        np.minimum(wall[window], away, out=wall[window])
        if tubes[n].hole:
            np.maximum(values[window], -distance, out=values[window])
        else:
            np.minimum(values[window], distance, out=values[window])
    seams = low + cell * np.argwhere(meeting & (np.abs(values) < cell))
    return ScalarGrid.uniform(values, low, cell), seams


def _window(mesh: Mesh, low: FloatArray, cell: float, shape: IntArray) -> tuple[slice, slice, slice]:
    """Block of nodes with all whose distance to a mesh is kept."""
    first = np.floor((mesh.vertices.min(axis=0) - low) / cell - BAND_CELLS).astype(np.int64)
    stop = np.ceil((mesh.vertices.max(axis=0) - low) / cell + BAND_CELLS).astype(np.int64) + 1
    first, stop = np.maximum(first, 0), np.minimum(stop, shape)
    a, b, c = (slice(int(start), int(end)) for start, end in zip(first, stop, strict=True))
    return a, b, c


def _distance(mesh: Mesh, low: FloatArray, cell: float, window: tuple[slice, slice, slice]) -> SingleArray:
    """Signed distances to a closed mesh at a block of nodes."""
    first = np.array([side.start for side in window])
    a, b, c = (side.stop - side.start for side in window)
    return np.asarray(grid_to_mesh(mesh, low + cell * first, cell, (a, b, c), BAND_CELLS).values, np.float32)
