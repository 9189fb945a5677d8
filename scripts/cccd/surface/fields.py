"""Signed distance fields of slices and of levels between them, in mm, negative inside."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import map_coordinates

from cccd.geometry.arrays import FloatArray, IntArray, SingleArray
from cccd.geometry.distance import to_mask

__all__ = ["LevelField", "distance_to_part", "sampled"]


@dataclass(frozen=True)
class LevelField:
    """Signed distances on one level.

    Attributes
    ----------
    z : float
        Height along the slice axis in mm (``k`` times the slice spacing).
    distance : (I, J) float32
        mm, negative inside.
    source_slice : int or None
        The source slice that it was taken from; None between slices.
    """

    z: float
    distance: SingleArray
    source_slice: int | None


def distance_to_part(distance: SingleArray, parts: IntArray, number: int, spacing: FloatArray) -> SingleArray:
    """Signed distances (I, J) in mm to one of a plane's connected parts.

    Parameters
    ----------
    distance : (I, J) float32
        To all parts, negative inside.
    parts : (I, J) int64
        Their numbers, 0 outside.
    number : int
    spacing : (2,) float64
        mm per pixel.
    """
    others = (parts > 0) & (parts != number)
    if not others.any():
        return distance
    own = to_mask(parts == number, spacing)
    return np.where(own <= to_mask(others, spacing), distance, own)


def sampled(plane: SingleArray, places: FloatArray) -> SingleArray:
    """Values (N,) of a plane (I, J) at places (N, 2) in pixels; beyond it, of its border."""
    return np.asarray(map_coordinates(plane, places.T, np.float32, order=1, mode="nearest"))
