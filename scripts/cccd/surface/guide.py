"""The organ's boundary as a smooth function of space: what the surface follows where tubes meet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit

from cccd.surface.fields import Field

__all__ = ["Guide"]

#: Knots of the smoothing spline lie this many pixels apart.
SMOOTHING_PIXELS = 2
#: A polynomial times the cubic B-spline whose second moment vanishes: curved outlines do not shrink.
FLAT_0, FLAT_2 = 27 / 17, -30 / 17


@dataclass(frozen=True, eq=False)
class Guide:
    """The fields of one or more stacks as one function of space.

    In the plane a field is smoothed by a kernel that takes the steps off its pixels; along z it runs
    straight from level to level.

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
    """

    planes: Sequence[np.ndarray]
    z: np.ndarray
    spacing: np.ndarray
    widest: float

    @classmethod
    def of(cls, fields: Sequence[Field], spacing: np.ndarray, widest: float) -> Guide:
        """Guide through fields that are sorted by height."""
        return cls(
            [level.distance for level in fields], np.array([level.z for level in fields]), spacing, widest
        )

    def __call__(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Distances (P,) in mm at points (P, 3) in the plane's mm and height, and how far they are known.

        The second array (P,) is the distance along z to where the levels end, zero beyond them.
        """
        value, room = np.zeros(len(points)), np.zeros(len(points))
        upper = np.searchsorted(self.z, points[:, 2], side="right")
        order = np.argsort(upper, kind="stable")
        stops = np.searchsorted(upper[order], np.arange(len(self.z) + 1))
        pixels = points[:, :2] / self.spacing
        gaps = np.diff(self.z)
        ends = np.concatenate(
            [self.z[:1], self.z[:-1][gaps > self.widest], self.z[1:][gaps > self.widest], self.z[-1:]]
        )
        for level in range(1, len(self.z)):
            here = order[stops[level] : stops[level + 1]]
            if len(here) == 0 or gaps[level - 1] > self.widest:
                continue
            z = points[here, 2]
            share = (z - self.z[level - 1]) / gaps[level - 1]
            value[here] = _smoothed(self.planes[level - 1], self.planes[level], pixels[here], share)
            room[here] = np.abs(z[:, None] - ends).min(axis=1)
        return value, room


@njit(cache=True)
def _smoothed(low, high, pixels, share):
    """Values (P,) between two planes at positions (P, 2) in pixels, smoothed in the plane."""
    height, width = low.shape
    out = np.zeros(len(pixels))
    taps = 4 * SMOOTHING_PIXELS
    weight = np.empty((2, taps))
    first = np.empty(2, np.int64)
    for p in range(len(pixels)):
        for axis in range(2):
            first[axis] = int(np.floor(pixels[p, axis])) - taps // 2 + 1
            total = 0.0
            for tap in range(taps):
                r = abs(first[axis] + tap - pixels[p, axis]) / SMOOTHING_PIXELS
                bell = 2 / 3 - r * r + r**3 / 2 if r < 1 else max(2 - r, 0.0) ** 3 / 6
                weight[axis, tap] = (FLAT_0 + FLAT_2 * r * r) * bell
                total += weight[axis, tap]
            weight[axis] /= total
        for a in range(taps):
            i = min(max(first[0] + a, 0), height - 1)
            for b in range(taps):
                j = min(max(first[1] + b, 0), width - 1)
                value = low[i, j] + share[p] * (high[i, j] - low[i, j])
                out[p] += weight[0, a] * weight[1, b] * value
    return out
