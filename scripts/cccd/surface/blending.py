"""One closed mesh of solids that meet, smooth where they do.

The signed distance to the joined splines, sampled on a grid, gives way to the organ's own distance near
the lines along which tubes meet: instead of a seam there is a blend. The zero level of the result is
closed, and nothing of it passes through itself.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cccd.geometry._jit import jit
from cccd.geometry.distance import grid_to_mesh
from cccd.geometry.grid import ScalarGrid
from cccd.geometry.mesh import Mesh

__all__ = ["LevelSet", "blended"]

#: Distances are kept up to this many cells to either side of the surface.
BAND_CELLS = 1.5
#: A blend fades out within this many cells of where the guide ends.
FADE_CELLS = 2.0
#: Distances from a seam are taken from points that lie this share of the blend's reach apart.
SEAM_STEP = 0.125
#: A surface does not run through the grid's nodes, but at least this share of a cell beside them.
NODE_MARGIN = 1e-4


@dataclass(frozen=True, eq=False)
class LevelSet:
    """Signed distances on a grid.

    Attributes
    ----------
    field : (A, B, C) float32
        mm, negative inside, cut off some cells away from the surface.
    low : (3,) float64
        mm of the first node.
    cell : float
        mm between nodes.
    """

    field: np.ndarray
    low: np.ndarray
    cell: float

    def mesh(self, level: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
        """Mesh the surface at a distance in mm by marching cubes (Lewiner et al. 2003).

        Gives vertices (V, 3) and outward faces (F, 3), both empty when nothing is inside.
        """
        field = self.field - np.float32(level)
        margin = np.float32(NODE_MARGIN * self.cell)
        np.copyto(field, np.where(field < 0, -margin, margin), where=np.abs(field) < margin)
        if not np.any(field < 0):
            return np.zeros((0, 3)), np.zeros((0, 3), np.int64)
        mesh = ScalarGrid.uniform(field, self.low, self.cell).isosurface(0.0)
        return mesh.vertices, mesh.faces


def blended(
    vertices: np.ndarray,
    faces: np.ndarray,
    seams: np.ndarray,
    guide: Callable[[np.ndarray, float], tuple[np.ndarray, np.ndarray]],
    reach: float,
    cell: float,
) -> LevelSet:
    """Sample the distance to a closed mesh, and to the guide's zero level near seams.

    Parameters
    ----------
    vertices, faces : (V, 3) float64 mm, (F, 3) int64
        A closed mesh; it may pass through itself.
    seams : (P, 3) float64
        Points of the lines along which tubes meet.
    guide : callable
        Gives at points (P, 3) the signed distance (P,) to the organ's boundary, which need be smooth only
        up to a given distance, and over how many mm (P,) it is known.
    reach : float
        mm from a seam at which the blend ends; it holds fully up to half of that.
    cell : float
        mm between the grid's nodes.
    """
    low = vertices.min(axis=0) - (3 + 1 / np.pi) * cell
    shape = tuple(int(size) for size in np.ceil((vertices.max(axis=0) - low) / cell) + 3)
    field = grid_to_mesh(Mesh(vertices, faces), low, cell, shape, BAND_CELLS).values
    if len(seams):
        places, reach_nodes = (seams - low) / cell, reach / cell
        bins = np.floor(places / max(1.0, SEAM_STEP * reach_nodes)).astype(np.int64)
        _, once = np.unique(bins, axis=0, return_index=True)
        weight = _weights(places[once], shape, reach_nodes)
        nodes = np.argwhere(weight)
        at = tuple(nodes.T)
        distance, room = guide(low + cell * nodes, BAND_CELLS * cell)
        share = weight[at] / 255 * np.clip(room / (FADE_CELLS * cell), 0, 1)
        limit = BAND_CELLS * cell
        distance = np.maximum(distance, -room)  # a lid at the guide's end stays where it is
        field[at] = (1 - share) * field[at] + share * np.clip(distance, -limit, limit)
    return LevelSet(field, low, cell)


@jit
def _weights(points, shape, reach):
    """Weights (A, B, C) in 255ths: full up to half of ``reach`` nodes from the nearest point, none at it."""
    weight = np.zeros(shape, np.uint8)
    for p in range(len(points)):
        x, y, z = points[p]
        for i in range(max(0, int(np.ceil(x - reach))), min(shape[0] - 1, int(x + reach)) + 1):
            for j in range(max(0, int(np.ceil(y - reach))), min(shape[1] - 1, int(y + reach)) + 1):
                square = (i - x) ** 2 + (j - y) ** 2
                if square >= reach**2:
                    continue
                for k in range(max(0, int(np.ceil(z - reach))), min(shape[2] - 1, int(z + reach)) + 1):
                    away = np.sqrt(square + (k - z) ** 2)
                    here = np.uint8(255 * min(1.0, max(0.0, 2 - 2 * away / reach)))
                    if here > weight[i, j, k]:
                        weight[i, j, k] = here
    return weight
