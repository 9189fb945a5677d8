"""Masks that were made on a coarser grid than the one they lie on.

Segmenters compute at a resolution of their own and copy each voxel of the result to the nearest voxels of the
scan: TotalSegmentator's are 1.5 or 3 mm, whatever the scan has. Borders then lie at multiples of that size. A
surface of such a mask has its blocks as stairs; one of the voxels that were computed has none.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from cccd.geometry.arrays import AnyArray, FloatArray, IntArray, SingleArray

# From which ratio of the grids' spacings on copies are looked for: below, too few voxels are copies to tell
# them from an organ's own flat sides.
_LEAST_RATIO = 1.15

# Odds against chance, as a logarithm, that axes with voxels of one size need together, and each of them: a
# thousand grids are tried, and in a thousand scans none shall fit by chance.
_SURE, _LIKELY = 14.0, 4.0

# Sizes that differ by less than this share are one: a whole number of voxels rounds them.
_SAME_SIZE = 0.1

# Segmenters compute at multiples of the first of these sizes, up to the second, mm.
_ROUND_MM, _COARSEST_MM = 0.25, 10.0

# The share of a grid's planes, from the first border to the last, at which borders lie.
_DENSE = 0.5

# Of so many lines along an axis one is looked at first: an organ on its own voxels has borders all along it.
_FEW = 8

# Rounding of a position by single precision, voxels.
_ROUNDED = 1e-4


@dataclass(frozen=True, eq=False)
class CoarserGrid:
    """The voxels of which a mask's are copies.

    Attributes
    ----------
    index : tuple of three (n,) int64
        Along each axis, the voxel of the mask that each voxel of the coarser grid is read from.
    affine : (4, 4) float64
        From the coarser grid's index to the mask's.
    """

    index: tuple[IntArray, IntArray, IntArray]
    affine: FloatArray

    def of(self, array: AnyArray) -> AnyArray:
        """Read an array (a, b, c) on the mask's grid at the coarser grid's voxels."""
        return array[np.ix_(*self.index)]

    def mean_of(self, image: SingleArray) -> SingleArray:
        """Average grey values (a, b, c) on the mask's grid over each voxel of the coarser grid."""
        for axis, index in enumerate(self.index):
            middle = self.affine[axis, 3] + self.affine[axis, axis] * np.arange(len(index))
            first = np.ceil(middle - self.affine[axis, axis] / 2).clip(0, index).astype(np.int64)
            counts = np.diff([*first, image.shape[axis]])
            sums = np.add.reduceat(image, first, axis, np.float64)
            image = (sums / np.expand_dims(counts, [other for other in range(3) if other != axis])).astype(
                np.float32
            )
        return image


@dataclass(frozen=True)
class _Axis:
    """Voxel k of the coarser grid has its centre at ``start + k * ratio`` of the mask's."""

    count: int
    ratio: float
    start: float
    size: float = 0.0  # of its voxels in mm
    odds: float = 0.0  # logarithm of the odds against chance

    @property
    def centres(self) -> FloatArray:
        """Where its voxels' centres (n,) lie, in the mask's voxels."""
        return self.start + self.ratio * np.arange(self.count, dtype=np.float64)


def find_coarser_grid(labels: AnyArray, spacing: FloatArray) -> CoarserGrid | None:
    """Find the grid that a mask or a label map was copied from, if it was.

    The first voxels of the two grids have their centres at the same place, and the last ones too or a round
    size; or the faces of the grids coincide. Arrays are resized in these ways.

    Parameters
    ----------
    labels : (a, b, c) bool or int
        The mask, or the map, which says more.
    spacing : (3,) float
        Of its voxels in mm.

    Returns
    -------
    CoarserGrid or None
        None where borders lie anywhere, or are too few to tell.

    Examples
    --------
    >>> mask = np.indices((20, 20, 20)).sum(axis=0) < 25
    >>> find_coarser_grid(mask, np.ones(3)) is None
    True
    >>> copied = mask.repeat(3, axis=0).repeat(3, axis=1).repeat(3, axis=2)
    >>> grid = find_coarser_grid(copied, np.ones(3))
    >>> bool((grid.of(copied) == mask).all())
    True
    """
    found = [
        _grids_of(_borders(labels, axis), size, float(mm))
        for axis, (size, mm) in enumerate(zip(labels.shape, spacing, strict=True))
    ]
    chosen: list[_Axis | None] = [None, None, None]
    for size in sorted({grid.size for grids in found for grid in grids}, reverse=True):
        alike = [
            own or next((grid for grid in grids if abs(grid.size / size - 1) < _SAME_SIZE), None)
            for own, grids in zip(chosen, found, strict=True)
        ]
        new = [grid for grid, own in zip(alike, chosen, strict=True) if grid is not None and own is None]
        if sum(grid.odds for grid in new) >= _SURE:
            chosen = alike
    if chosen == [None, None, None]:
        return None
    axes = [grid or _Axis(size, 1.0, 0.0) for grid, size in zip(chosen, labels.shape, strict=True)]
    a, b, c = (
        np.clip(np.rint(grid.centres), 0, size - 1).astype(np.int64)
        for grid, size in zip(axes, labels.shape, strict=True)
    )
    affine = np.diag([*(grid.ratio for grid in axes), 1.0])
    affine[:3, 3] = [grid.start for grid in axes]
    return CoarserGrid((a, b, c), affine)


def _borders(labels: AnyArray, axis: int) -> IntArray:
    """Voxels (B,) along an axis of which any differs from its next; none where they are too dense to tell."""
    layers = np.moveaxis(labels, axis, 0)
    few = _changes(layers[:, ::_FEW, ::_FEW])
    if len(few) and len(few) > 1 + (few[-1] - few[0] + 1) / _LEAST_RATIO:
        return few[:0]
    return _changes(layers)


def _changes(layers: AnyArray) -> IntArray:
    """Layers of which any voxel differs from the next layer's."""
    return np.flatnonzero([(layer != after).any() for layer, after in pairwise(layers)])


def _grids_of(borders: IntArray, size: int, mm: float) -> list[_Axis]:
    """Find grids, from the coarsest to the finest, on whose planes all borders along an axis lie."""
    if len(borders) < 2:
        return []
    span = borders[-1] - borders[0] + 1
    tried: list[_Axis] = []
    for count in range(2, int(size / _LEAST_RATIO) + 1):
        faces, centres = size / count, (size - 1) / (count - 1)
        tried += [_Axis(count, centres, 0.0), _Axis(count, faces, (faces - 1) / 2)]
    for size_mm in _ROUND_MM * np.arange(1, min(size * mm / 2, _COARSEST_MM) / _ROUND_MM):
        ratio = float(size_mm / mm)
        tried.append(_Axis(int((size - 1) / ratio + 0.5) + 1, ratio, 0.0))  # up to the mask's last voxel
    found: list[_Axis] = []
    for grid in tried:
        if grid.ratio < _LEAST_RATIO or len(borders) * grid.ratio < _DENSE * span:
            continue
        odds = _odds(borders, grid)
        if odds >= _LIKELY:
            found.append(replace(grid, size=grid.ratio * mm, odds=odds))
    return sorted(found, key=lambda grid: grid.count)


def _odds(borders: IntArray, grid: _Axis) -> float:
    """Give the logarithm of the odds that borders lie on a grid's planes not by chance; 0 where one does not.

    A plane through a voxel's centre may be a border on either of its sides: twice as likely by chance, unless
    all are on the same.
    """
    first = grid.start - grid.ratio / 2
    plane = first + grid.ratio * np.ceil((borders - first) / grid.ratio - _ROUNDED)
    after, before = plane - borders, borders + 1 - plane
    if before.min() < -_ROUNDED:
        return 0.0
    low, high = after <= _ROUNDED, before <= _ROUNDED
    either = float((low | high).mean()) if low.any() and high.any() else 0.0
    return len(borders) * float(np.log(grid.ratio / (1 + either)))
