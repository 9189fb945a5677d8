"""What people have in memory, as an array and its grid: arrays, and images of nibabel and SimpleITK."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, cast

import numpy as np
from nibabel.spatialimages import SpatialImage

from cccd.errors import InputError
from cccd.geometry.arrays import AnyArray, FloatArray
from cccd.inputs.readers import itk_affine


def array_of(
    organ: Any, affine: Any = None, spacing: Sequence[float] | None = None
) -> tuple[AnyArray, FloatArray]:
    """Take voxels and their grid.

    Parameters
    ----------
    organ : array, nibabel or SimpleITK image
        An image brings its grid.
    affine : (4, 4) float, optional
        Grid of an array, index to world mm (RAS).
    spacing : three floats, optional
        Or the lengths of its voxels, mm.

    Raises
    ------
    InputError
        Something else, a grid that is given twice, or lengths that are not three.

    Examples
    --------
    >>> import numpy as np
    >>> voxels, grid = array_of(np.zeros((4, 5, 6)), spacing=(1, 1, 2.5))
    >>> voxels.shape, grid.diagonal().tolist()
    ((4, 5, 6), [1.0, 1.0, 2.5, 1.0])
    """
    if affine is not None and spacing is not None:
        raise InputError("spacing", "the affine has it already", "give one of them")
    own: tuple[AnyArray, FloatArray] | None = None
    if isinstance(organ, SpatialImage):
        own = np.asanyarray(organ.dataobj), np.asarray(organ.affine, float)
    elif type(organ).__module__.startswith("SimpleITK"):  # imported by whoever made it
        import SimpleITK as sitk  # noqa: N813

        if organ.GetDimension() == 3:
            own = sitk.GetArrayFromImage(organ).T, itk_affine(organ)
    elif isinstance(organ, (np.ndarray, list)) or hasattr(organ, "__array__"):
        return np.asarray(cast(Any, organ)), _grid(affine, spacing)
    if own is None:
        what = f"{type(organ).__name__} is no mask in three dimensions"
        raise InputError("organ", what, "give an array, a nibabel or SimpleITK image, or cccd.read(path)")
    if affine is not None or spacing is not None:
        raise InputError("affine", "an image has a grid of its own", "leave affine and spacing out")
    return own


def _grid(affine: Any, spacing: Sequence[float] | None) -> FloatArray:
    """Affine (4, 4) of an array; voxels of one millimetre where nothing is given."""
    if spacing is None:
        return np.eye(4) if affine is None else np.asarray(affine, float)
    lengths = np.asarray(spacing, float)
    if lengths.shape != (3,):
        raise InputError(
            "spacing", f"{spacing!r} is no three lengths", "give mm along the array's three axes"
        )
    return np.diag([*lengths, 1.0])
