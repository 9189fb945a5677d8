"""Signed distances to a mesh on a grid."""

from __future__ import annotations

import numpy as np

from cccd.geometry.arrays import FloatArray
from cccd.geometry.distance import unsigned_to_mesh
from cccd.geometry.grid import ScalarGrid
from cccd.geometry.mesh import Mesh
from cccd.geometry.raster import voxelise

#: Nodes of a grid are looked at in cubes of so many along each side: only those near a mesh.
_BLOCK = 3


def grid_to_mesh(
    mesh: Mesh, origin: FloatArray, spacing: float, shape: tuple[int, int, int], band: float
) -> ScalarGrid:
    """Signed distance to a closed mesh at the nodes of a grid, cut off at a band to either side of it.

    Parameters
    ----------
    mesh : Mesh
        It may pass through itself.
    origin, spacing, shape
        The grid: its first node (3,), the distance between nodes, and their number (A, B, C).
    band : float
        Distances are kept up to this many nodes.

    Returns
    -------
    ScalarGrid
        float32, in the unit of the mesh.
    """
    grid = ScalarGrid.uniform(np.full(shape, band * spacing, np.float32), origin, spacing)
    blocks = np.argwhere(np.ones([-(-n // _BLOCK) for n in shape], np.bool_)) * _BLOCK
    middle = unsigned_to_mesh(origin + spacing * (blocks + (_BLOCK - 1) / 2), mesh)
    blocks = blocks[middle < spacing * (band + _BLOCK * 3**0.5 / 2)]
    for step in np.ndindex(_BLOCK, _BLOCK, _BLOCK):
        nodes = blocks + step
        nodes = nodes[np.all(nodes < shape, axis=1)]
        grid.values[tuple(nodes.T)] = np.minimum(
            unsigned_to_mesh(origin + spacing * nodes, mesh), band * spacing
        )
    np.negative(grid.values, out=grid.values, where=voxelise(mesh, grid.affine, shape))
    return grid
