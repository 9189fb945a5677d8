"""How near the nodes of a grid lie to some points: weights that fade away from them."""

from __future__ import annotations

import numpy as np

from cccd.geometry._jit import jit
from cccd.geometry.arrays import ByteArray, FloatArray

__all__ = ["seam_weights"]

#: Distances are taken from points that lie this share of the reach apart.
SEAM_STEP = 0.25


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
    """Weights (A, B, C) in 255ths: full up to half of ``reach`` nodes from the nearest point, none at it."""
    # Nodes on the grid's faces have none: they stay outside the mesh, and what is meshed is closed.
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
