"""The target of the lofted surface: the organ's boundary as signed distances in space."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cccd.geometry.arrays import FloatArray, SingleArray
from cccd.surface.fields import LevelField, sampled

__all__ = ["TargetField", "smoothing_weights"]

#: mm: the distance where nothing is known.
NOWHERE = 1e6
#: A polynomial times the cubic B-spline whose second moment vanishes: curved outlines do not shrink.
FLAT_0, FLAT_2 = 27 / 17, -30 / 17


@dataclass(frozen=True, eq=False)
class TargetField:
    """The fields of one or more runs of levels as one signed distance in space.

    Attributes
    ----------
    planes : sequence of (I, J) float32
        Signed distances in mm, negative inside, level by level.
    z : (L,) float64
        Heights of the levels in mm, ascending.
    spacing : (2,) float64
        mm per pixel along i and j.
    widest : float
        Levels further apart than this in mm have nothing to say about what lies between them.
    knot : float
        Pixels between the knots of the spline that is to smooth them.
    """

    planes: Sequence[SingleArray]
    z: FloatArray
    spacing: FloatArray
    widest: float
    knot: float

    @classmethod
    def of(cls, fields: Sequence[LevelField], spacing: FloatArray, widest: float, knot: float) -> TargetField:
        """Target through fields that are sorted by height."""
        planes, z = [level.distance for level in fields], np.array([level.z for level in fields])
        return cls(planes, z, spacing, widest, knot)

    def __call__(self, points: FloatArray) -> FloatArray:
        """Distances (P,) in mm at points (P, 3) in the plane's mm and height; `NOWHERE` without levels."""
        value = np.full(len(points), NOWHERE)
        low = np.searchsorted(self.z, points[:, 2], side="right") - 1
        low[points[:, 2] == self.z[-1]] = len(self.z) - 2
        pixels = points[:, :2] / self.spacing
        for n in map(int, np.unique(low[(low >= 0) & (low < len(self.z) - 1)])):
            gap = self.z[n + 1] - self.z[n]
            if gap > self.widest:
                continue
            here = low == n
            below, above = (sampled(self.planes[m], pixels[here]) for m in (n, n + 1))
            value[here] = below + (points[here, 2] - self.z[n]) / gap * (above - below)
        return value


def smoothing_weights(x: FloatArray) -> FloatArray:
    """Weights of the smoothing at distances (...,) to either side, in knots; they do not sum to one."""
    r = np.abs(x)
    bell = np.where(r < 1, 2 / 3 - r**2 + r**3 / 2, np.maximum(2 - r, 0) ** 3 / 6)
    return (FLAT_0 + FLAT_2 * r**2) * bell
