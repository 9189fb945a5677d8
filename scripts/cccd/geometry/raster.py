"""Shapes to pixels and voxels: those whose centres lie inside."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from cccd.geometry.arrays import BoolArray, FloatArray, IntArray, RealArray, ranks_of
from cccd.geometry.mesh import Mesh
from cccd.geometry.polygons import RaggedPolygons
from cccd.tolerances import ROUNDING


def rasterise(
    polygons: RaggedPolygons | Sequence[RealArray], origin: Sequence[int] | RealArray, shape: tuple[int, int]
) -> BoolArray:
    """Pixels whose centres lie in or on polygons (even-odd rule, so holes are holes).

    Parameters
    ----------
    polygons : RaggedPolygons or sequence of (n, 2)
        Parts outside the image are cut off.
    origin : (2,) int
        Index (i, j) of the image's first pixel.
    shape : (I, J)

    Returns
    -------
    (I, J) bool array

    Examples
    --------
    >>> square = np.array([(1.0, 1), (1, 3), (2, 3), (2, 1)])
    >>> rasterise([square], (0, 0), (4, 5)).astype(int)
    array([[0, 0, 0, 0, 0],
           [0, 1, 1, 1, 0],
           [0, 1, 1, 1, 0],
           [0, 0, 0, 0, 0]])
    """
    if not isinstance(polygons, RaggedPolygons):
        polygons = RaggedPolygons.of(polygons)
    moved = RaggedPolygons(polygons.points - np.asarray(origin, float), polygons.offsets)
    return rasterise_layers(moved, np.zeros(len(polygons), np.int64), (1, *shape))[0]


def rasterise_layers(polygons: RaggedPolygons, layer: IntArray, shape: tuple[int, int, int]) -> BoolArray:
    """Fill many images at once: each polygon into its own layer of a stack, by the even-odd rule.

    Parameters
    ----------
    polygons : RaggedPolygons
        In pixels of the images.
    layer : (C,) int array
        Image that each polygon is drawn into; those outside the stack are left out.
    shape : (S, I, J)
        Number of images, and their shape.

    Returns
    -------
    (S, I, J) bool array

    Notes
    -----
    A centre on a polygon counts as inside, so the pixel-centre polygons of a mask's borders (outer borders
    and holes) give back the mask itself. Every edge toggles the parity of the pixels to its right on each
    row ``i`` that it crosses; a row counts for an edge from its lower end up to, but without, its upper
    end, so that a shared vertex is counted once. What lies exactly on an edge is added afterwards.
    """
    points = polygons.points
    layers, rows, columns = shape
    parity = np.zeros(shape, np.uint8)
    if len(points) == 0 or parity.size == 0:
        return parity.astype(bool)
    start, end = points, points[polygons.successors]
    layer = np.repeat(layer, polygons.sizes)
    here = (layer >= 0) & (layer < layers)
    start, end, layer = start[here], end[here], layer[here]

    upward = start[:, 0] <= end[:, 0]
    low = np.where(upward[:, None], start, end)
    high = np.where(upward[:, None], end, start)
    edge, row = _integers_between(low[:, 0], high[:, 0], rows)
    rise = (high - low)[edge]
    level = rise[:, 0] == 0  # the row runs along the edge
    share: FloatArray = np.divide(row - low[edge, 0], rise[:, 0], out=np.zeros(len(row)), where=~level)
    column: FloatArray = low[edge, 1] + share * rise[:, 1]
    nearest = np.rint(column)
    exact = np.abs(column - nearest) <= ROUNDING * np.maximum(1.0, np.abs(column))
    column = np.where(exact, nearest, column)

    crossing = ~level & (row < high[edge, 0])
    entry = np.maximum(np.ceil(column), 0).astype(np.int64)
    flat = (layer[edge] * rows + row) * columns
    kept = crossing & (entry < columns)
    np.add.at(parity.reshape(-1), (flat + entry)[kept], np.uint8(1))
    # Unsigned bytes wrap at 256, which is even: the parity survives any number of crossings.
    inside = (np.add.accumulate(parity, axis=2, dtype=np.uint8) & 1).astype(bool)

    touched = ~level & exact & (column >= 0) & (column < columns)
    inside.reshape(-1)[(flat + entry)[touched]] = True
    along = edge[level]
    left = np.minimum(low[along, 1], high[along, 1])
    right = np.maximum(low[along, 1], high[along, 1])
    which, along_row = _integers_between(left, right, columns)
    inside.reshape(-1)[flat[level][which] + along_row] = True
    return inside


def _integers_between(low: FloatArray, high: FloatArray, stop: int) -> tuple[IntArray, IntArray]:
    """Every integer of ``[low[n], high[n]]`` within ``[0, stop)``, with the n it belongs to."""
    first = np.maximum(np.ceil(low), 0).astype(np.int64)
    last = np.minimum(np.floor(high), stop - 1).astype(np.int64)
    count = np.maximum(last - first + 1, 0)
    owner = np.repeat(np.arange(len(count)), count)
    return owner, first[owner] + ranks_of(count)


#: Share of a voxel by which vertices are moved aside: on a line of voxels they would be counted once, twice
#: or not at all, and rounding would decide for faces through voxel centres.
_ASIDE = np.array([5.13e-7, 3.71e-7, 2.72e-7])


def voxelise(
    mesh: Mesh,
    affine: FloatArray,
    shape: tuple[int, int, int],
    origin: Sequence[int] | RealArray = (0, 0, 0),
) -> BoolArray:
    """Voxels whose centres a closed mesh that is oriented outwards winds around.

    Parameters
    ----------
    mesh : Mesh
        Closed.
    affine : (4, 4) float64
        ``position = affine @ (a, b, c, 1)`` for the index of a voxel.
    shape : (A, B, C)
        Of the block of voxels to fill.
    origin : (3,) int
        Index of the block's first voxel.

    Returns
    -------
    (A, B, C) bool array
    """
    index = (mesh.vertices - affine[:3, 3]) @ np.linalg.inv(affine[:3, :3]).T - np.asarray(origin)
    crossings = np.zeros((shape[0], shape[1], shape[2] + 1), np.int8)
    _add_crossings(index + _ASIDE, mesh.faces, crossings)
    winding = np.add.accumulate(crossings, axis=2, dtype=np.int8)[:, :, :-1]
    mirrored = np.linalg.det(affine[:3, :3]) < 0
    return winding < 0 if mirrored else winding > 0


def _add_crossings(index: FloatArray, faces: IntArray, crossings: npt.NDArray[np.int8]) -> None:
    """Mark where the lines along the third axis pass through the triangles: 1 where they enter, -1 after."""
    na, nb, nc = crossings.shape
    p, q, r = (index[faces[:, corner]] for corner in range(3))
    low, high = (choose(choose(p, q), r) for choose in (np.minimum, np.maximum))
    face, a = _integers_between(low[:, 0], high[:, 0], na)
    row, b = _integers_between(low[face, 1], high[face, 1], nb)
    face, a = face[row], a[row]
    p, q, r = p[face], q[face], r[face]
    area = _doubled_area(p, q, r[:, 0], r[:, 1])
    crossed = area != 0
    size = np.where(crossed, area, 1.0)
    share = [_doubled_area(*side, a, b) / size for side in ((q, r), (r, p), (p, q))]
    crossed &= (share[0] >= 0) & (share[1] >= 0) & (share[2] >= 0)
    height = share[0] * p[:, 2] + share[1] * q[:, 2] + share[2] * r[:, 2]
    c = np.clip(np.ceil(height[crossed]), 0, nc - 1).astype(np.int64)
    np.add.at(crossings, (a[crossed], b[crossed], c), np.where(area[crossed] > 0, -1, 1).astype(np.int8))


def _doubled_area(p: FloatArray, q: FloatArray, a: RealArray, b: RealArray) -> FloatArray:
    """Twice the signed areas (N,) of triangles in the plane: of two corners (N, 3) and a third (a, b)."""
    return (q[:, 0] - p[:, 0]) * (b - p[:, 1]) - (a - p[:, 0]) * (q[:, 1] - p[:, 1])


def dice(
    truth: np.ndarray, predicted: np.ndarray, axis: int | tuple[int, ...] | None = None
) -> np.ndarray | float:
    """Dice score, eq. (20), of regions of one shape, over all axes or some; two empty regions agree (1)."""
    if np.shape(truth) != np.shape(predicted):
        raise ValueError(f"truth {np.shape(truth)} and prediction {np.shape(predicted)} differ in shape")
    both = np.asarray(np.count_nonzero(np.logical_and(truth, predicted), axis=axis))
    total = np.asarray(np.count_nonzero(truth, axis=axis) + np.count_nonzero(predicted, axis=axis))
    return np.divide(2 * both, total, out=np.ones(np.shape(total)), where=total > 0)[()]
