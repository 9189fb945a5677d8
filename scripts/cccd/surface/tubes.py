"""Tubes: what a body is made of, each a sequence of closed sections that ends in one of four ways."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import shapely

from cccd.geometry.arrays import FloatArray
from cccd.geometry.polygons import signed_area
from cccd.surface.rings import Ring

__all__ = ["EndKind", "Section", "Tube"]

#: Why a tube ends: in its trunk, by itself, at the scan's border, or as a hole that meets the outside.
EndKind = Literal["joined", "cap", "cut", "opens"]


@dataclass(frozen=True, eq=False)
class Section:
    """One cross-section of a tube: a closed polygon (n, 2) in mm at height ``z``, and its area in mm^2."""

    z: float
    points: FloatArray
    area: float

    @classmethod
    def of_ring(cls, ring: Ring, z: float | None = None) -> Section:
        """Section with a ring's outline and the area that it stands for, at its height or another."""
        return cls(ring.z if z is None else z, ring.points, ring.area)

    @classmethod
    def of_outline(cls, z: float, points: FloatArray) -> Section:
        """Section with the area of its own polygon."""
        return cls(z, points, abs(signed_area(points)))

    @classmethod
    def of_polygon(cls, z: float, polygon: shapely.Polygon) -> Section:
        """Section along a polygon's outer border, counter-clockwise."""
        points = np.array(polygon.exterior.coords)[:-1]
        return cls.of_outline(z, points if signed_area(points) >= 0 else points[::-1])


@dataclass(frozen=True, eq=False)
class Tube:
    """Sections from the lowest to the highest, and how the two ends close.

    Attributes
    ----------
    sections : list of Section
        Heights ascend.
    poles : pair of (3,) float64 or None
        For the low and the high end the point in mm on which the tube closes smoothly; None where a
        planar cap closes it.
    hole : bool
        Whether the tube bounds a cavity.
    depth : int
        How many rings surround it; see `Ring`.
    ends : pair of str
        Why it ends there: ``joined`` to a trunk, ``cap``, ``cut`` by the scan, or a hole that ``opens``.
    """

    sections: list[Section]
    poles: tuple[FloatArray | None, FloatArray | None]
    hole: bool
    depth: int
    ends: tuple[EndKind, EndKind]
