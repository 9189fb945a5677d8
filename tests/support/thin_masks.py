"""Masks of what is one or two voxels thick: endplates of a spine, a shell, ribs, an iliac wing.

Each function returns a mask (a, b, c) of bool, whose slices run along the last axis, and its affine (4, 4)
in mm. At least three voxels are empty on every side.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

#: Label map of a CT of 3 mm next to the checkout, and the value of its left hip (TotalSegmentator v2).
ILIAC_WING = Path(__file__).resolve().parents[3] / "shared/data/liver_totalseg_ct3mm/labels.nii.gz"
_HIP_LEFT = 77

#: Of a sagittal spine, mm: pixels, and slices from left to right.
_PIXEL, _SLICE = 0.586, 3.3
#: Vertebrae, and mm from one to the next; height of a body and its half-axes, front to back, left to right.
_COUNT, _PITCH = 5, 27.0
_HEIGHT, _DEEP, _WIDE = 21.0, 15.0, 20.0


def _planes() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Coordinates in mm of a sagittal grid, (a, b, c) each: front, up, side; and its affine."""
    shape = np.ceil([2 * _DEEP / _PIXEL + 34, _COUNT * _PITCH / _PIXEL + 24, 2 * _WIDE / _SLICE + 8]).astype(
        int
    )
    step = np.array([_PIXEL, _PIXEL, _SLICE])
    index = np.indices(tuple(shape)).astype(float)
    middle = (shape - 1) / 2
    front, up, side = ((index[axis] - middle[axis]) * step[axis] for axis in range(3))
    # columns run along the second axis, slices along x of the world
    affine = np.zeros((4, 4))
    affine[1, 0], affine[2, 1], affine[0, 2], affine[3, 3] = _PIXEL, _PIXEL, _SLICE, 1
    return front, up, side, affine


def _faces(number: int, front: np.ndarray, side: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Heights in mm of a vertebra's lower and upper face, and where they are: within an ellipse."""
    place = number - (_COUNT - 1) / 2
    lean = 0.12 * place  # a lordosis: every vertebra is tilted against the next
    share = (front / _DEEP) ** 2 + (side / _WIDE) ** 2
    hollow = 2.5 * (1 - share)  # faces are concave
    middle = place * _PITCH + lean * front
    return middle - _HEIGHT / 2 + hollow, middle + _HEIGHT / 2 - hollow, share <= 1


def endplates() -> tuple[np.ndarray, np.ndarray]:
    """Endplates of five vertebrae: ten curved, tilted sheets, one voxel thick along the spine."""
    front, up, side, affine = _planes()
    mask = np.zeros(up.shape, bool)
    for number in range(_COUNT):
        low, high, within = _faces(number, front, side)
        for height in (low, high):
            mask |= within & (np.abs(up - height + 1e-9) <= _PIXEL / 2)
    return mask, affine


def spine() -> tuple[np.ndarray, np.ndarray]:
    """Five vertebral bodies, and between them their endplates: sheets of one voxel, three voxels away."""
    front, up, side, affine = _planes()
    mask = np.zeros(up.shape, bool)
    for number in range(_COUNT):
        low, high, within = _faces(number, front, side)
        mask |= within & (up >= low + 3.5 * _PIXEL) & (up <= high - 3.5 * _PIXEL)
    return mask | endplates()[0], affine


def shell(radius: float = 20.0) -> tuple[np.ndarray, np.ndarray]:
    """Spherical shell of one voxel: every voxel whose centre lies within half a voxel of a sphere."""
    size = int(2 * np.ceil(radius) + 9)
    middle = (size - 1) / 2
    away = np.linalg.norm(np.indices((size,) * 3) - middle, axis=0)
    return np.abs(away - radius) <= 0.5, np.eye(4)


def ribs(thick: int = 1, slices: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Six oblique ribs around a chest: bars of ``thick`` voxels, which touch by faces, edges or corners.

    Parameters
    ----------
    thick : int
        Voxels across a bar, along every axis.
    slices : float
        Distance between slices, mm; pixels are of 1 mm.
    """
    angle = np.deg2rad(np.linspace(-75, 75, 4000))
    bars = []
    for side in (-1, 1):
        for height in (0.0, 24.0, 48.0):
            across, forward = side * 55 * np.cos(angle), 40 * np.sin(angle)
            bars.append(np.column_stack([across, forward, height - 14 * np.sin(angle)]))
    points = np.concatenate(bars) / (1, 1, slices)
    index = np.round(points - points.min(axis=0)).astype(int) + 4
    mask = np.zeros(index.max(axis=0) + 5 + thick, bool)
    for shift in np.ndindex(thick, thick, thick):
        mask[tuple((index + shift).T)] = True
    return mask, np.diag([1, 1, slices, 1.0])


def iliac_wing(path: Path = ILIAC_WING) -> tuple[np.ndarray, np.ndarray] | None:
    """Left hip of a label map of 3 mm, its wing one voxel thick; ``None`` where the file is absent.

    The scan's lower end cuts it flat.
    """
    if not path.exists():
        return None
    from nibabel.nifti1 import Nifti1Image

    image = Nifti1Image.from_filename(path)
    mask = np.asarray(image.dataobj) == _HIP_LEFT
    margin = 4
    where = np.argwhere(mask)
    low = where.min(axis=0)
    cut = np.pad(mask[tuple(slice(a, b + 1) for a, b in zip(low, where.max(axis=0), strict=True))], margin)
    affine = np.array(image.affine, float)
    affine[:3, 3] += affine[:3, :3] @ (low - margin)
    return cut, affine


#: All of them; the iliac wing may be ``None``.
THIN_MASKS: dict[str, Callable[[], tuple[np.ndarray, np.ndarray] | None]] = {
    "endplates": endplates,
    "spine": spine,
    "shell": shell,
    "ribs of one voxel": ribs,
    "ribs of two voxels": lambda: ribs(2),
    "ribs of two voxels, slices of 3 mm": lambda: ribs(2, 3.0),
    "iliac wing": iliac_wing,
}
