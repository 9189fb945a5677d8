"""The target of the lofted surface: the organ's boundary as a smooth function of space.

What the surface follows where tubes meet.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from cccd.geometry._jit import jit
from cccd.geometry.arrays import FloatArray, IntArray, SingleArray
from cccd.surface.fields import LevelField

__all__ = ["TargetDistance", "TargetField", "smoothing_weights"]

#: Returns at points (P, 3) the signed distance (P,) to the organ's boundary, which need be smooth only up to
#: a given distance, and over how many mm (P,) it is known.
TargetDistance = Callable[[FloatArray, float], tuple[FloatArray, FloatArray]]

#: A polynomial times the cubic B-spline whose second moment vanishes: curved outlines do not shrink.
FLAT_0, FLAT_2 = 27 / 17, -30 / 17


@dataclass(frozen=True, eq=False)
class TargetField:
    """The fields of one or more runs of levels as one signed distance in space.

    Fields are smoothed by a kernel that takes the steps of pixels and slices off them.

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
        Pixels between the knots of the smoothing.
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

    def __call__(self, points: FloatArray, within: float = np.inf) -> tuple[FloatArray, FloatArray]:
        """Distances (P,) in mm at points (P, 3) in the plane's mm and height, and how far they are known.

        The second array (P,) is the distance along z to where the levels end, zero beyond them. Only
        distances of up to about ``within`` mm are smoothed; minus infinity for none.
        """
        by_height = np.argsort(points[:, 2], kind="stable")
        z, pixels = points[by_height, 2], points[by_height, :2] / self.spacing
        value, room = self._linear(z, pixels)
        knot = self.knot * float(np.sqrt(self.spacing.prod()))
        near = np.flatnonzero((room > 0) & (np.abs(value) < within + knot / 2))
        if len(near):
            value[near] = self._smoothed(z[near], pixels[near], knot)
        back = np.empty(len(points), np.int64)
        back[by_height] = np.arange(len(points))
        return value[back], room[back]

    def _linear(self, z: FloatArray, pixels: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Distances (P,) at ascending heights and at positions (P, 2) in pixels, by linear interpolation.

        The second array (P,) is the distance along z to where the levels end; both are zero beyond them.
        """
        gaps = np.diff(self.z)
        wide = gaps > self.widest
        starts = np.concatenate([self.z[:1], self.z[1:][wide]])
        ends = np.concatenate([self.z[:-1][wide], self.z[-1:]])
        run = np.cumsum(wide)
        value, room = np.zeros(len(z)), np.zeros(len(z))
        stops: IntArray = np.searchsorted(z, self.z)
        for n in map(int, np.flatnonzero(~wide & (np.diff(stops) > 0))):
            here = slice(stops[n], stops[n + 1])
            low, high = (_sampled(self.planes[m], pixels[here], 0.0) for m in (n, n + 1))
            value[here] = low + (z[here] - self.z[n]) / gaps[n] * (high - low)
            room[here] = np.minimum(z[here] - starts[run[n]], ends[run[n]] - z[here])
        return value, room

    def _smoothed(self, z: FloatArray, pixels: FloatArray, knot: float) -> FloatArray:
        """Smoothed distances (P,) at ascending heights and at positions (P, 2) in pixels."""
        thickness = np.minimum(np.gradient(self.z), knot)
        total, weights = np.zeros(len(z)), np.zeros(len(z))
        for level, plane, thick in zip(self.z, self.planes, thickness, strict=True):
            here = slice(*np.searchsorted(z, [level - 2 * knot, level + 2 * knot]))
            if here.start == here.stop:
                continue
            weight = thick * _kernels((z[here] - level) / knot)
            total[here] += weight * _sampled(plane, pixels[here], self.knot)
            weights[here] += weight
        return total / weights


def smoothing_weights(x: FloatArray) -> FloatArray:
    """Weights of the smoothing at distances (...,) to either side, in knots; they do not sum to one."""
    return _kernels(np.abs(x).ravel()).reshape(x.shape)


@jit
def _kernel(r: float) -> float:
    """Weight at a distance in knots."""
    bell = 2 / 3 - r * r + r**3 / 2 if r < 1 else max(2 - r, 0.0) ** 3 / 6
    return (FLAT_0 + FLAT_2 * r * r) * bell


@jit
def _kernels(x: FloatArray) -> FloatArray:
    """Weights at distances (P,) to either side, in knots."""
    out = np.empty_like(x)
    for p in range(len(x)):
        out[p] = _kernel(abs(x[p]))
    return out


@jit
def _sampled(plane: SingleArray, pixels: FloatArray, knot: float) -> FloatArray:
    """Values (P,) of a plane at positions (P, 2) in pixels, smoothed, or linear where ``knot`` is 0."""
    height, width = plane.shape
    out = np.zeros(len(pixels))
    taps = 2 * int(np.ceil(2 * knot)) if knot else 2
    weight = np.empty((2, taps))
    first = np.empty(2, np.int64)
    for p in range(len(pixels)):
        for axis in range(2):
            first[axis] = int(np.floor(pixels[p, axis])) - taps // 2 + 1
            total = 0.0
            for tap in range(taps):
                away = abs(first[axis] + tap - pixels[p, axis])
                weight[axis, tap] = _kernel(away / knot) if knot else 1 - away
                total += weight[axis, tap]
            for tap in range(taps):  # compiled in a fifth of the time of ``weight[axis] /= total``
                weight[axis, tap] /= total
        for a in range(taps):
            i = min(max(first[0] + a, 0), height - 1)
            for b in range(taps):
                j = min(max(first[1] + b, 0), width - 1)
                out[p] += weight[0, a] * weight[1, b] * plane[i, j]
    return out
