"""One closed mesh of solids that meet, smooth where they do.

The signed distance to the joined splines, sampled on a grid, gives way to the organ's own distance near
the lines along which tubes meet: instead of a seam there is a blend. The zero level of the result is
closed, and nothing of it passes through itself.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numba import njit
from skimage.measure import marching_cubes

from cccd.containers import Frame
from cccd.metrics import voxelise

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
        index, faces, _, _ = marching_cubes(field, 0.0)
        return self.low + self.cell * index.astype(float), faces.astype(np.int64)


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
    affine = np.diag([cell, cell, cell, 1.0])
    affine[:3, 3] = low
    inside = voxelise(vertices, faces, Frame(affine, 2, shape), np.zeros(3), shape)
    field = np.full(shape, BAND_CELLS * cell, np.float32)
    _approach(np.ascontiguousarray((vertices - low) / cell), faces, field, BAND_CELLS, cell)
    np.negative(field, out=field, where=inside)
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


@njit(cache=True)
def _approach(vertices, faces, field, band, cell):
    """Lower a field (A, B, C) to the distance from the triangles, where they are within ``band`` nodes."""
    first, last = np.empty(3, np.int64), np.empty(3, np.int64)
    for f in range(len(faces)):
        a, b, c = _point(vertices, faces[f, 0]), _point(vertices, faces[f, 1]), _point(vertices, faces[f, 2])
        for axis in range(3):
            first[axis] = max(0, int(np.ceil(min(a[axis], b[axis], c[axis]) - band)))
            last[axis] = min(field.shape[axis] - 1, int(max(a[axis], b[axis], c[axis]) + band))
        for i in range(first[0], last[0] + 1):
            for j in range(first[1], last[1] + 1):
                for k in range(first[2], last[2] + 1):
                    point = (float(i), float(j), float(k))
                    distance = cell * np.sqrt(_squared_distance(point, a, b, c))
                    if distance < field[i, j, k]:
                        field[i, j, k] = distance


@njit(cache=True)
def _point(vertices, n):
    return (vertices[n, 0], vertices[n, 1], vertices[n, 2])


@njit(cache=True)
def _along(a, share, b):
    """Give ``a + share * b``."""
    return (a[0] + share * b[0], a[1] + share * b[1], a[2] + share * b[2])


@njit(cache=True)
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True)
def _squared_distance(point, a, b, c):
    """Squared distance from a point to a triangle (Ericson 2005, section 5.1.5)."""
    ab, ac, ap = _along(b, -1.0, a), _along(c, -1.0, a), _along(point, -1.0, a)
    d1, d2 = _dot(ab, ap), _dot(ac, ap)
    if d1 <= 0 and d2 <= 0:
        return _dot(ap, ap)
    bp = _along(point, -1.0, b)
    d3, d4 = _dot(ab, bp), _dot(ac, bp)
    if d3 >= 0 and d4 <= d3:
        return _dot(bp, bp)
    if d1 * d4 - d3 * d2 <= 0 and d1 >= 0 and d3 <= 0 and d1 > d3:
        rest = _along(ap, -d1 / (d1 - d3), ab)
        return _dot(rest, rest)
    cp = _along(point, -1.0, c)
    d5, d6 = _dot(ab, cp), _dot(ac, cp)
    if d6 >= 0 and d5 <= d6:
        return _dot(cp, cp)
    if d5 * d2 - d1 * d6 <= 0 and d2 >= 0 and d6 <= 0 and d2 > d6:
        rest = _along(ap, -d2 / (d2 - d6), ac)
        return _dot(rest, rest)
    if d3 * d6 - d5 * d4 <= 0 and d4 >= d3 and d5 >= d6 and d4 - d3 + d5 - d6 > 0:
        rest = _along(bp, -(d4 - d3) / (d4 - d3 + d5 - d6), _along(c, -1.0, b))
        return _dot(rest, rest)
    x = ab[1] * ac[2] - ab[2] * ac[1]
    y = ab[2] * ac[0] - ab[0] * ac[2]
    z = ab[0] * ac[1] - ab[1] * ac[0]
    size = x * x + y * y + z * z
    return (ap[0] * x + ap[1] * y + ap[2] * z) ** 2 / size if size > 0 else _dot(ap, ap)


@njit(cache=True)
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
