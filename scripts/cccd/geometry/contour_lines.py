"""Contour lines of the plane."""

from __future__ import annotations

from functools import lru_cache
from typing import cast

import contourpy
import numpy as np

from cccd.geometry.arrays import FloatArray, RealArray

__all__ = ["zero_contours"]


def zero_contours(plane: RealArray) -> list[FloatArray]:
    """Contours (n, 2) in pixels along which a plane (I, J) is zero, each with its first point once more.

    Around what is negative they run counter-clockwise in (i, j), around holes in it clockwise.

    Examples
    --------
    >>> plane = np.ones((3, 3))
    >>> plane[1, 1] = -1
    >>> zero_contours(plane)[0].tolist()
    [[0.5, 1.0], [1.0, 0.5], [1.5, 1.0], [1.0, 1.5], [0.5, 1.0]]
    """
    rows, columns = _pixel_grid(*plane.shape)
    generator = contourpy.contour_generator(columns, rows, plane)
    return [line[:, ::-1] for line in cast("list[FloatArray]", generator.lines(0.0))]


@lru_cache(maxsize=4)
def _pixel_grid(height: int, width: int) -> tuple[FloatArray, FloatArray]:
    """Rows and columns (H, W) of a plane's pixels, which contourpy would make anew for every plane."""
    rows, columns = np.indices((height, width), float)
    return rows, columns
