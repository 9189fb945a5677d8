"""Limits on what a file may ask for, checked against its header before its voxels are read."""

from __future__ import annotations

import math
from collections.abc import Sequence

from cccd.errors import InputError
from cccd.settings.imports import LimitSettings

__all__ = ["check_count", "check_size"]


def check_count(count: int, limits: LimitSettings, name: str, location: str) -> None:
    """Refuse more of something than the limit ``most_<name>`` allows.

    Examples
    --------
    >>> check_count(7, LimitSettings(most_slices=5), "slices", "a.nii")
    Traceback (most recent call last):
    ...
    cccd.errors.InputError: a.nii: it has 7 slices, and 5 are allowed; set import.limits.most_slices higher
    """
    most = getattr(limits, f"most_{name}")
    if count > most:
        what = name.replace("_", " ")
        raise InputError(
            location,
            f"it has {count} {what}, and {most} are allowed",
            f"set import.limits.most_{name} higher",
        )


def check_size(shape: Sequence[int], limits: LimitSettings, location: str, slice_axis: int = -1) -> None:
    """Refuse a volume with more slices, larger slices or more voxels than the limits allow.

    Parameters
    ----------
    shape : sequence of int
        Voxels along each axis, as a header says; axes of colours or times included.
    limits : LimitSettings
        Section ``import.limits`` of the configuration.
    location : str
        What messages name.
    slice_axis : int
        The axis along which slices run.

    Raises
    ------
    InputError
        Names the limit.
    """
    sizes = [int(size) for size in shape]
    voxels, slices = math.prod(sizes), sizes[slice_axis] if sizes else 1
    check_count(slices, limits, "slices", location)
    check_count(voxels // max(slices, 1), limits, "pixels", location)
    check_count(voxels, limits, "voxels", location)
