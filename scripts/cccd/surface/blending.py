"""Solids that meet, smooth where they do: signed distances on a grid, and the mesh at their zero level.

The signed distance to the joined splines gives way to the organ's own distance near the lines along which
tubes meet: instead of a seam there is a blend. In walls it gives way in part: splines along the slice axis
and distances between slices err differently, and their mean errs less. The zero level of the result is
closed, and nothing of it passes through itself.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cccd.geometry._jit import jit
from cccd.geometry.arrays import ByteArray, FloatArray, SingleArray
from cccd.geometry.grid import ScalarGrid
from cccd.geometry.mesh import Mesh
from cccd.settings.surface import BlendingSettings
from cccd.surface.stack import SliceStack
from cccd.surface.target import TargetDistance
from cccd.surface.union import BAND_CELLS
from cccd.tolerances import ROUNDING

__all__ = ["blend", "blend_reach", "blend_weights", "points_on_surface", "seam_weights", "zero_surface"]

#: Distances from a seam are taken from points that lie this share of the blend's reach apart.
SEAM_STEP = 0.25
#: A surface does not run through the grid's nodes, but at least this share of a cell beside them.
NODE_MARGIN = 1e-4


def blend_reach(stack: SliceStack, settings: BlendingSettings) -> float:
    """How far in mm a blend reaches to either side of the lines along which tubes meet."""
    return max(settings.reach_pixels * stack.pixel, settings.reach_steps * stack.step)


def blend_weights(
    grid: ScalarGrid, seams: FloatArray, reach: float, everywhere: float, settings: BlendingSettings
) -> ByteArray:
    """Share that the target has at a grid's nodes: along seams, in walls, and everywhere where it knows more.

    Parameters
    ----------
    grid : ScalarGrid
        Signed distances in mm, as `cccd.surface.union.unite_on_grid` returns them.
    seams : (P, 3) float64
        Points of the lines along which tubes meet.
    reach : float
        mm from a seam at which the blend ends; it holds fully up to half of that.
    everywhere : float
        Share along the whole surface: 0 where the target only mends the tubes, 1 where it tells more than
        they do.
    settings : BlendingSettings
        Of these ``wall_share`` and ``wall_tilts``.

    Returns
    -------
    (A, B, C) uint8
        In 255ths.
    """
    low, cell, shape = grid.affine[:3, 3], float(grid.affine[0, 0]), grid.values.shape
    values = np.ascontiguousarray(grid.values, np.float32)
    weight = _wall_weights(values, BAND_CELLS * cell, settings.wall_share, settings.wall_tilts)
    if len(seams):
        weight = np.maximum(weight, seam_weights((seams - low) / cell, shape, reach / cell))
    if everywhere > 0:
        along = seam_weights((points_on_surface(grid) - low) / cell, shape, reach / cell)
        weight = np.maximum(weight, (everywhere * along).astype(np.uint8))
    return weight


def blend(grid: ScalarGrid, weight: ByteArray, target: TargetDistance, fade_cells: float) -> ScalarGrid:
    """Let the distance to joined tubes give way to that to the target's zero level.

    Parameters
    ----------
    grid : ScalarGrid
        Signed distances in mm, as `cccd.surface.union.unite_on_grid` returns them.
    weight : (A, B, C) uint8
        The target's share at every node in 255ths, see `blend_weights`.
    target : callable
        Distance to the organ's boundary; see `TargetDistance`.
    fade_cells : float
        The blend fades out within so many cells of where the target ends.

    Returns
    -------
    ScalarGrid
        float32, mm, negative inside, cut off some cells away from the surface.
    """
    low, cell = grid.affine[:3, 3], float(grid.affine[0, 0])
    nodes = np.argwhere(weight.transpose(2, 0, 1))[:, [1, 2, 0]]  # by height, as the target is sampled
    if len(nodes) == 0:
        return grid
    at = tuple(nodes.T)
    limit = BAND_CELLS * cell
    distance, room = target(low + cell * nodes, limit)
    share = weight[at] / 255 * np.clip(room / (fade_cells * cell), 0, 1)
    distance = np.maximum(distance, -room)  # a planar cap at the target's end stays where it is
    values = grid.values.copy()
    values[at] = (1 - share) * values[at] + share * np.clip(distance, -limit, limit)
    return replace(grid, values=values)


def points_on_surface(distance: ScalarGrid) -> FloatArray:
    """Nodes (P, 3) of a grid twice as coarse that lie within half of its cell of the zero level."""
    cell = float(distance.affine[0, 0])
    coarse = np.argwhere(np.abs(distance.values[::2, ::2, ::2]) < cell)
    return distance.affine[:3, 3] + 2 * cell * coarse


def seam_weights(points: FloatArray, shape: tuple[int, int, int], reach: float) -> ByteArray:
    """Weights (A, B, C) of a blend in 255ths, full up to half of ``reach`` from points (P, 3); in nodes."""
    return _weights(_thinned(points, reach), shape, reach)


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


@jit
def _wall_weights(values: SingleArray, band: float, share: float, tilts: tuple[float, float]) -> ByteArray:
    """Weights (A, B, C) in 255ths within a band: a share where the surface is steep, none where flat."""
    steep, flat = tilts
    weight = np.zeros(values.shape, np.uint8)
    for i in range(1, values.shape[0] - 1):
        for j in range(1, values.shape[1] - 1):
            for k in range(1, values.shape[2] - 1):
                if abs(values[i, j, k]) >= band:
                    continue
                across = values[i + 1, j, k] - values[i - 1, j, k], values[i, j + 1, k] - values[i, j - 1, k]
                up = values[i, j, k + 1] - values[i, j, k - 1]
                size = np.sqrt(across[0] ** 2 + across[1] ** 2 + up**2)
                rise = flat * size - abs(up)
                if rise > 0:
                    wall = rise / max((flat - steep) * size, ROUNDING)
                    weight[i, j, k] = np.uint8(255 * share * min(1.0, wall))
    return weight


def zero_surface(distance: ScalarGrid) -> Mesh:
    """Mesh the surface at a grid's zero level."""
    values = np.abs(distance.values)
    np.maximum(values, NODE_MARGIN * float(distance.affine[0, 0]), out=values)
    return replace(distance, values=np.copysign(values, distance.values, out=values)).isosurface(0.0)
