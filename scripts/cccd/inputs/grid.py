"""Grids: affines, axis orders, the slice axis, cropping.

All affines are RAS millimetres of voxel centres: ``world = affine @ (a, b, c, 1)``.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, Literal, cast

import nibabel.orientations as untyped
import numpy as np
import numpy.typing as npt
import scipy

from cccd.errors import InputError
from cccd.geometry.arrays import AnyArray, BoolArray, FloatArray, IntArray
from cccd.inputs.coarser_grid import CoarserGrid
from cccd.tolerances import ORTHOGONALITY

#: nibabel: its functions have no types.
orientations = cast(Any, untyped)

#: LPS and RAS differ by the sign of the first two axes.
LPS_TO_RAS = np.diag([-1.0, -1.0, 1.0, 1.0])
#: Tilted slices lie no flatter than this share of the distance between their first pixels (70 degrees).
FLATTEST = 1 / 3
#: Two grids are the same when their affines agree to this share of a voxel at every corner.
SAME_GRID_VOXELS = 0.05
#: Spacings that differ by less than this share count as equal when the slice axis is chosen.
SAME_SPACING = 0.05


@dataclass
class Volume:
    """A scan as it was read.

    Attributes
    ----------
    data : (a, b, c) array
        Grey values or labels in the file's own axis order.
    affine : (4, 4) float64
        Index to world mm (RAS).
    location : str
        Its name in messages: that of the file or folder.
    names : dict of int to str
        Names of labels where the file holds them.
    instances : tuple of str
        SOP instance UIDs of a DICOM series.
    frame_of_reference : str
        DICOM frame of reference UID.
    uneven : bool
        Some slices of the grid were not scanned: nothing is known about them.
    coarser : CoarserGrid or None
        The grid that a mask's voxels were copied from.
    warnings : list of str
        What the reader noticed.
    """

    data: AnyArray
    affine: FloatArray
    location: str
    names: dict[int, str] = field(default_factory=dict[int, str])
    instances: tuple[str, ...] = ()
    frame_of_reference: str = ""
    uneven: bool = False
    coarser: CoarserGrid | None = None
    warnings: list[str] = field(default_factory=list[str])

    @property
    def shape(self) -> tuple[int, int, int]:
        """Voxels along each axis."""
        a, b, c = self.data.shape
        return a, b, c


def check_affine(affine: npt.ArrayLike | None, location: str) -> FloatArray:
    """Refuse an affine that does not describe a scanner's grid.

    Parameters
    ----------
    affine : (4, 4) float or None
        Index to world mm; None where the file has none.
    location : str
        What messages name.

    Returns
    -------
    (4, 4) float64
        The same affine.

    Raises
    ------
    InputError
        Not finite, voxels without extent, or no two axes at right angles to `ORTHOGONALITY`: those of a
        slice are, also where the gantry is tilted.
    """
    affine = np.asarray(affine, np.float64)
    if affine.shape != (4, 4):
        raise InputError(location, f"its affine has shape {affine.shape}", "give a 4 x 4 matrix")
    if not np.isfinite(affine).all():
        raise InputError(location, "its affine is not finite", "export the scan again")
    spacing = np.linalg.norm(affine[:3, :3], axis=0)
    if (spacing <= 0).any():
        sizes = " x ".join(f"{size:g}" for size in spacing)
        raise InputError(
            location, f"its voxels have no extent ({sizes} mm)", "correct the spacing in its header"
        )
    if not _across_rectangles(affine) or abs(np.linalg.det(affine[:3, :3] / spacing)) < FLATTEST:
        raise InputError(
            location,
            "no two of its axes are at right angles, or two nearly run along each other (sheared affine)",
            "resample the scan to an orthogonal grid first",
        )
    return affine


def _across_rectangles(affine: FloatArray) -> list[int]:
    """Axes of a grid along which slices may run: the other two are at right angles."""
    directions = affine[:3, :3] / np.linalg.norm(affine[:3, :3], axis=0)
    cosines = np.abs(directions.T @ directions)
    return [axis for axis in range(3) if cosines[axis - 2, axis - 1] <= ORTHOGONALITY]


def find_slice_axis(affine: FloatArray, choice: str | int = "auto") -> int:
    """Choose the axis along which slices run: 0, 1 or 2.

    Parameters
    ----------
    affine : (4, 4) float64
        Index to world mm (RAS).
    choice : "auto" or int
        The axis itself, or ``"auto"``: the axis of the largest spacing, and among those equal to
        `SAME_SPACING` the one nearest to superior-inferior. Where slices are tilted, those axes count of
        which the other two are at right angles.

    Raises
    ------
    InputError
        The axis of choice has other axes that are not at right angles.

    Examples
    --------
    >>> find_slice_axis(np.diag([0.8, 5.0, 0.8, 1.0]))
    1
    >>> find_slice_axis(np.eye(4))
    2
    """
    possible = _across_rectangles(affine)
    if choice != "auto":
        if int(choice) not in possible:
            hint = f"set it to {' or '.join(map(str, possible))}, or auto"
            raise InputError("import: slice_axis", f"slices across axis {choice} are no rectangles", hint)
        return int(choice)
    columns = affine[:3, :3]
    spacing = np.linalg.norm(columns, axis=0)
    thickest = spacing >= spacing[possible].max() * (1 - SAME_SPACING)
    thickest &= np.isin(np.arange(3), possible)
    return int(np.argmax(np.where(thickest, np.abs(columns[2]) / spacing, -1.0)))


def same_grid(first: FloatArray, second: FloatArray, shape: tuple[int, ...]) -> bool:
    """Whether two affines (4, 4) agree at every corner of a grid to `SAME_GRID_VOXELS` of a voxel."""
    size = np.linalg.norm(first[:3, :3], axis=0).min()
    return bool(farthest_apart(first, second, shape) <= SAME_GRID_VOXELS * size)


def farthest_apart(first: FloatArray, second: FloatArray, shape: tuple[int, ...]) -> float:
    """Largest distance in mm between the places where two affines (4, 4) put a corner of a grid."""
    corners = np.stack(np.meshgrid(*[(0, max(n - 1, 1)) for n in shape], indexing="ij"), -1).reshape(-1, 3)
    shift = corners @ (first - second)[:3, :3].T + (first - second)[:3, 3]
    return float(np.linalg.norm(shift, axis=1).max())


def on_grid(
    volume: Volume, affine: FloatArray, shape: tuple[int, ...], fill: float | None = None
) -> Volume | None:
    """Move ``volume`` to another grid by reordering, flipping, cropping and padding alone.

    Parameters
    ----------
    volume : Volume
        What to move.
    affine : (4, 4) float
        The other grid's index to world mm (RAS).
    shape : tuple of int
        The other grid's shape.
    fill : float, optional
        Value of voxels that ``volume`` does not cover; without it the volume has to cover the grid. Voxels
        beyond the grid must then equal it as well, so that nothing of a mask is cut off.

    Returns
    -------
    Volume or None
        None where the voxels of the two grids do not coincide.
    """
    # of the volume's axes on the grid
    turn = orientations.io_orientation(np.linalg.solve(affine, volume.affine))
    data = cast(AnyArray, orientations.apply_orientation(volume.data, turn))
    moved = cast(FloatArray, volume.affine @ orientations.inv_ornt_aff(turn, volume.shape))
    start = np.rint(np.linalg.solve(affine, moved)[:3, 3]).astype(int)
    shifted = affine.copy()
    shifted[:3, 3] += affine[:3, :3] @ start
    if not same_grid(shifted, moved, data.shape):
        return None
    low, high = np.maximum(start, 0), np.minimum(start + data.shape, shape)
    if (high <= low).any():
        return None
    there = tuple(slice(a, b) for a, b in zip(low - start, high - start, strict=True))
    if fill is None:
        covers = (low == 0).all() and (high == shape).all()
        return replace(volume, data=data[there], affine=affine) if covers else None
    if np.count_nonzero(data != fill) != np.count_nonzero(data[there] != fill):
        return None
    placed = np.pad(data[there], np.column_stack([low, shape - high]).astype(int), constant_values=fill)
    return replace(volume, data=placed, affine=affine)


def interpolate_on_grid(
    volume: Volume, affine: FloatArray, shape: tuple[int, ...], order: Literal[0, 1]
) -> Volume:
    """Interpolate ``volume`` on another grid; beyond its faces the nearest voxels go on.

    Parameters
    ----------
    volume : Volume
        What to interpolate.
    affine : (4, 4) float64
        The other grid's index to world mm (RAS).
    shape : tuple of int
        The other grid's shape.
    order : 0 or 1
        0 copies the nearest voxel (labels), 1 interpolates linearly (grey values).

    See Also
    --------
    on_grid : The same without interpolation, where the voxels coincide.
    """
    relation = np.linalg.inv(volume.affine) @ affine
    data = scipy.ndimage.affine_transform(
        volume.data, relation[:3, :3], relation[:3, 3], tuple(shape), order=order, mode="nearest"
    )
    return replace(volume, data=data, affine=affine)


def bounding_box(mask: BoolArray) -> tuple[IntArray, IntArray]:
    """First and last index (3,) int64 of the voxels set in a mask (a, b, c), which holds at least one."""
    spans = [np.flatnonzero(mask.any(axis=tuple({0, 1, 2} - {axis}))) for axis in range(3)]
    return np.array([span[0] for span in spans]), np.array([span[-1] for span in spans])


def crop(array: AnyArray, first: IntArray, last: IntArray) -> AnyArray:
    """Crop an array to ``array[first:last + 1]``.

    Parameters
    ----------
    array : (a, b, c) bool or float
        A mask or grey values.
    first, last : (3,) int
        First and last index of the crop, which may lie beyond the array's faces: a mask is False there, grey
        values are those on the face.

    Examples
    --------
    >>> crop(np.ones((1, 1, 2), bool), np.array([0, 0, -1]), np.array([0, 0, 1])).ravel().tolist()
    [False, True, True]
    """
    first, last, shape = np.asarray(first), np.asarray(last), np.array(array.shape)
    inside = tuple(slice(max(a, 0), b + 1) for a, b in zip(first, last, strict=True))
    beyond = [(max(-a, 0), max(b + 1 - n, 0)) for a, b, n in zip(first, last, shape, strict=True)]
    kept = np.ascontiguousarray(array[inside])  # in the same order however the file has its voxels
    if array.dtype == bool:
        return np.pad(kept, beyond)
    return np.pad(kept, beyond, mode="edge")
