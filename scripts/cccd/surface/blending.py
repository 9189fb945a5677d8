"""Solids that meet, smooth where they do: signed distances on a grid, and the mesh at their zero level.

The signed distance to the joined splines gives way to the organ's own distance near the lines along which
tubes meet: instead of a seam there is a blend. The zero level of the result is closed, and nothing of it
passes through itself.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from cccd.geometry._jit import jit
from cccd.geometry.arrays import ByteArray, FloatArray, SingleArray
from cccd.geometry.distance import grid_to_mesh
from cccd.geometry.grid import ScalarGrid
from cccd.geometry.mesh import Mesh
from cccd.settings.surface import BlendingSettings
from cccd.surface.stack import SliceStack

__all__ = ["TargetDistance", "blend", "blend_reach", "offset_surface"]

#: Distances are kept up to this many cells to either side of the surface.
BAND_CELLS = 1.5
#: Distances from a seam are taken from points that lie this share of the blend's reach apart.
SEAM_STEP = 0.125
#: A surface does not run through the grid's nodes, but at least this share of a cell beside them.
NODE_MARGIN = 1e-4

#: Returns at points (P, 3) the signed distance (P,) to the organ's boundary, which need be smooth only up to
#: a given distance, and over how many mm (P,) it is known.
TargetDistance = Callable[[FloatArray, float], tuple[FloatArray, FloatArray]]


def blend_reach(stack: SliceStack, settings: BlendingSettings) -> float:
    """How far in mm a blend reaches to either side of the lines along which tubes meet."""
    return max(settings.reach_pixels * stack.pixel, settings.reach_steps * stack.step)


def blend(
    mesh: Mesh, seams: FloatArray, target: TargetDistance, reach: float, cell: float, fade_cells: float
) -> ScalarGrid:
    """Sample the distance to a closed mesh, and to the target's zero level near seams.

    Parameters
    ----------
    mesh : Mesh
        Closed; it may pass through itself.
    seams : (P, 3) float64
        Points of the lines along which tubes meet.
    target : callable
        Distance to the organ's boundary; see `TargetDistance`.
    reach : float
        mm from a seam at which the blend ends; it holds fully up to half of that.
    cell : float
        mm between the grid's nodes.
    fade_cells : float
        The blend fades out within so many cells of where the target ends.

    Returns
    -------
    ScalarGrid
        float32, mm, negative inside, cut off some cells away from the surface.
    """
    low = mesh.vertices.min(axis=0) - (3 + 1 / np.pi) * cell
    count = np.ceil((mesh.vertices.max(axis=0) - low) / cell) + 3
    shape = (int(count[0]), int(count[1]), int(count[2]))
    grid = grid_to_mesh(mesh, low, cell, shape, BAND_CELLS)
    if len(seams) == 0:
        return grid
    weight = _weights(_thinned((seams - low) / cell, reach / cell), shape, reach / cell)
    nodes = np.argwhere(weight)
    at = tuple(nodes.T)
    limit = BAND_CELLS * cell
    distance, room = target(low + cell * nodes, limit)
    share = weight[at] / 255 * np.clip(room / (fade_cells * cell), 0, 1)
    distance = np.maximum(distance, -room)  # a planar cap at the target's end stays where it is
    values = grid.values.copy()
    values[at] = (1 - share) * values[at] + share * np.clip(distance, -limit, limit)
    return replace(grid, values=values)


def _thinned(points: FloatArray, reach: float) -> FloatArray:
    """Keep one of the points (P, 3) in every cube of some share of the reach; all in nodes."""
    bins = np.floor(points / max(1.0, SEAM_STEP * reach)).astype(np.int64)
    _, once = np.unique(bins, axis=0, return_index=True)
    return points[once]


@jit
def _weights(points: FloatArray, shape: tuple[int, int, int], reach: float) -> ByteArray:
    """Weights (A, B, C) in 255ths: full up to half of ``reach`` nodes from the nearest point, none at it.

    Nodes on the grid's faces have none: they stay outside the mesh, and what is meshed is closed.
    """
    weight = np.zeros(shape, np.uint8)
    for p in range(len(points)):
        x, y, z = points[p]
        for i in range(max(1, int(np.ceil(x - reach))), min(shape[0] - 2, int(x + reach)) + 1):
            for j in range(max(1, int(np.ceil(y - reach))), min(shape[1] - 2, int(y + reach)) + 1):
                square = (i - x) ** 2 + (j - y) ** 2
                if square >= reach**2:
                    continue
                for k in range(max(1, int(np.ceil(z - reach))), min(shape[2] - 2, int(z + reach)) + 1):
                    away = np.sqrt(square + (k - z) ** 2)
                    here = np.uint8(255 * min(1.0, max(0.0, 2 - 2 * away / reach)))
                    if here > weight[i, j, k]:
                        weight[i, j, k] = here
    return weight


def offset_surface(distance: ScalarGrid, offset: float = 0.0) -> Mesh:
    """Mesh the surface ``offset`` mm outside a grid's zero level, outwards; empty when nothing is inside."""
    values: SingleArray = distance.values - np.float32(offset)
    margin = np.float32(NODE_MARGIN * distance.affine[0, 0])
    values = np.where(np.abs(values) < margin, np.where(values < 0, -margin, margin), values)
    if not np.any(values < 0):
        return Mesh.empty()
    return replace(distance, values=values).isosurface(0.0)
