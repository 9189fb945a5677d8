"""A label map on another grid: the voxels of its organs' surfaces."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from scipy import ndimage

from cccd.containers import Grid
from cccd.errors import InputError
from cccd.geometry.arrays import IntArray, SingleArray
from cccd.geometry.mesh import Mesh
from cccd.geometry.raster import voxelise
from cccd.inputs.grid import Volume
from cccd.inputs.row_files import label_values
from cccd_labels.label_maps import MapLabel
from cccd_labels.voxels import block_of, voxels_within
from cccd_labels.whole_map import LabelSurface, WholeMap

#: A voxel's share is counted at so many points along each of its edges.
POINTS = 4
#: More voxels than that are not written.
MOST_VOXELS = 2_000_000_000


def finer_grid(volume: Volume, voxel: float) -> Grid:
    """Lay cubic voxels over the space that those of a volume take.

    Examples
    --------
    >>> thick = Volume(np.zeros((10, 10, 4)), np.diag([1.0, 1.0, 5.0, 1.0]), "")
    >>> grid = finer_grid(thick, 2.0)
    >>> grid.shape, grid.affine[:3, 3].tolist()
    ((5, 5, 10), [0.5, 0.5, -1.5])
    """
    spacing = np.linalg.norm(volume.affine[:3, :3], axis=0)
    shape = np.maximum(np.ceil(np.array(volume.data.shape) * spacing / voxel - 1e-6), 1).astype(int)
    if shape.prod(dtype=float) > MOST_VOXELS:
        problem = f"{voxel:g} mm make {shape.prod(dtype=float):.2g} voxels"
        raise InputError("--voxel", problem, "give a larger one")
    affine = volume.affine.copy()
    affine[:3, :3] *= voxel / spacing
    affine[:3, 3] = volume.affine @ [-0.5, -0.5, -0.5, 1] @ np.eye(4)[:, :3] + affine[:3, :3].sum(axis=1) / 2
    return Grid(affine, (int(shape[0]), int(shape[1]), int(shape[2])))


def relabelled(
    whole: WholeMap, grid: Grid, n_jobs: int = 1, tell: Callable[[str], None] = lambda what: None
) -> Iterator[tuple[int, LabelSurface | None, IntArray]]:
    """Give the voxels of another grid that each label of a map has; no voxel comes twice.

    Parameters
    ----------
    whole : WholeMap
    grid : Grid
    n_jobs, tell
        See `WholeMap.surfaces`.

    Yields
    ------
    value : int
        The label.
    surface : LabelSurface or None
        None of a label without a surface, such as one of few voxels: its nearest voxels are taken.
    voxels : (N,) int64
        Flat indices on the grid.
    """
    taken = np.zeros(grid.shape, np.bool_).ravel()
    made: set[int] = set()
    for one in whole.surfaces(n_jobs, tell):
        made.add(one.number)
        inside = voxels_within(one.surface.lofted.mesh, grid.affine, grid.shape)
        yield _value(one.label, one.number), one, _claimed(inside, taken)
    left = {number: label for number, label in whole.labels.items() if number not in made}
    volume = label_values(whole.path) if left else None
    if volume is not None:
        nearest = _nearest(volume, grid)
        for number, label in left.items():
            value = _value(label, number)
            yield value, None, _claimed(np.flatnonzero(nearest == value), taken)


def _value(label: MapLabel, number: int) -> int:
    """Value of a label in the map: its own, or its number where it has a name alone."""
    return int(label.label) if label.label.isdecimal() else number


def _claimed(voxels: IntArray, taken: np.ndarray[tuple[int], np.dtype[np.bool_]]) -> IntArray:
    """Leave out voxels that others have, and mark the rest."""
    free = voxels[~taken[voxels]]
    taken[free] = True
    return free


def share_of_voxels(mesh: Mesh, grid: Grid) -> tuple[IntArray, SingleArray]:
    """Which share of each voxel a mesh holds: the first voxel (3,) of a block, and its shares (A, B, C)."""
    low, shape = block_of(mesh, grid.affine, grid.shape)
    fine = grid.affine @ np.diag([*(1 / POINTS,) * 3, 1.0])
    fine[:3, 3] = (grid.affine @ [*(low - 0.5 + 0.5 / POINTS), 1])[:3]
    a, b, c = shape
    if 0 in shape:
        return low, np.zeros(shape, np.float32)
    inside = voxelise(mesh, fine, (a * POINTS, b * POINTS, c * POINTS))
    parts = inside.reshape(a, POINTS, b, POINTS, c, POINTS)
    return low, parts.mean(axis=(1, 3, 5), dtype=np.float32)


def _nearest(volume: Volume, grid: Grid) -> IntArray:
    """Values of the nearest voxels of a volume at those of a grid, flat; 0 beyond it."""
    relation = np.linalg.solve(volume.affine, grid.affine)
    matrix, offset = relation[:3, :3], relation[:3, 3]
    return ndimage.affine_transform(
        volume.data, matrix, offset, grid.shape, order=0, mode="grid-constant"
    ).ravel()
