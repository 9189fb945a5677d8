"""Limits on what a file may ask for, checked against its header before its voxels are read."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from cccd.errors import InputError

__all__ = ["LIMITS", "Limits", "check_count", "check_size"]


@dataclass(frozen=True)
class Limits:
    """What a file may ask for: a damaged or hostile header must not fill the memory.

    Attributes
    ----------
    slices : int
        Of a volume, or images of a series: several times a whole body at half a millimetre.
    pixels : int
        Of one slice, 10,000 squared: micrographs have fewer.
    voxels : int
        Of a volume: a packed file of some megabytes can promise a thousand times its size; these are 8 GB.
    contours : int
        Drawn ones of one region (RTSTRUCT): dozens on every slice of a whole body.
    contour_points : int
        Of all these contours together, some hundred points each: half a gigabyte.
    """

    slices: int = 20_000
    pixels: int = 100_000_000
    voxels: int = 4_000_000_000
    contours: int = 100_000
    contour_points: int = 20_000_000


#: What every file is held against.
LIMITS = Limits()


def check_count(count: int, limits: Limits, name: str, location: str) -> None:
    """Refuse more of something than its limit.

    Examples
    --------
    >>> check_count(7, Limits(slices=5), "slices", "a.nii")
    Traceback (most recent call last):
    ...
    cccd.errors.InputError: a.nii: it has 7 slices, and 5 are allowed; mend its header, or give a part of it
    """
    most = getattr(limits, name)
    if count > most:
        raise InputError(
            location,
            f"it has {count} {name.replace('_', ' ')}, and {most} are allowed",
            "mend its header, or give a part of it",
        )


def check_size(shape: Sequence[int], limits: Limits, location: str) -> None:
    """Refuse a volume with more slices, larger slices or more voxels than the limits allow.

    Parameters
    ----------
    shape : sequence of int
        Voxels along each axis, as a header says, the last across slices; axes of colours or times included.
    limits : Limits
    location : str
        What messages name.

    Raises
    ------
    InputError
        Names the limit.
    """
    sizes = [int(size) for size in shape]
    voxels, slices = math.prod(sizes), sizes[-1] if sizes else 1
    check_count(slices, limits, "slices", location)
    check_count(voxels // max(slices, 1), limits, "pixels", location)
    check_count(voxels, limits, "voxels", location)
