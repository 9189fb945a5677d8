"""The surface's target where probabilities are known: their level of one half, smooth in space."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from cccd.containers import Frame, ProbabilityStack
from cccd.geometry.arrays import FloatArray, IntArray, SingleArray
from cccd.surface.target import TargetField

__all__ = ["ProbabilityTarget"]

#: Pixels of nothing around the stack, so that its cubic spline ends there without ripples.
BEYOND = 3
#: So far from one half the probabilities begin to be certain: distances to the slices' outlines take over.
CERTAIN = (0.25, 0.45)


@dataclass(frozen=True, eq=False)
class ProbabilityTarget:
    """Cubic spline through probabilities, as distances to where it is one half.

    Near that level the distance is the probability's difference from one half by its mean slope; where
    probabilities are certain it is that to the slices' outlines, with the sign of the probabilities.

    Attributes
    ----------
    coefficients : (S, I, J) float32
        Of the cubic spline through one half less the probabilities.
    origin : (3,) int64
        Slice, and pixel of the outlines' plane, of the first coefficient.
    voxel : (3,) float64
        Distance between slices, and a pixel's edges along i and j, in mm.
    slope : float
        Mean slope of the probabilities along the level, per mm.
    outlines : TargetField
        Distances to the slices' outlines.
    """

    coefficients: SingleArray
    origin: IntArray
    voxel: FloatArray
    slope: float
    outlines: TargetField

    @classmethod
    def of(
        cls,
        stack: ProbabilityStack,
        frame: Frame,
        plane_origin: IntArray,
        outlines: TargetField,
    ) -> ProbabilityTarget:
        """Target of a stack whose outlines' plane begins at source pixel ``plane_origin`` (2,)."""
        voxel = np.array([frame.slice_spacing, *frame.pixel_spacing])
        sides = ((0, 0), (BEYOND, BEYOND), (BEYOND, BEYOND))
        level = np.pad(np.float32(0.5) - stack.values, sides, constant_values=np.float32(0.5))
        coefficients = np.asarray(ndimage.spline_filter(level, 3, np.float32, "nearest"))
        corner = np.array([0, BEYOND + plane_origin[0], BEYOND + plane_origin[1]])
        first = np.asarray(stack.origin, np.int64) - corner
        return cls(coefficients, first, voxel, _slope(level, voxel), outlines)

    def __call__(self, points: FloatArray) -> FloatArray:
        """Distances (P,) in mm at points (P, 3) in the plane's mm and height."""
        index = points[:, [2, 0, 1]] / self.voxel - self.origin
        level = ndimage.map_coordinates(self.coefficients, index.T, order=3, mode="nearest", prefilter=False)
        near = level / self.slope
        far = self.outlines(points)
        share = np.clip((np.abs(level) - CERTAIN[0]) / (CERTAIN[1] - CERTAIN[0]), 0, 1)
        certain = np.copysign(np.maximum(np.abs(far), np.abs(near)), level)
        return near + share * (certain - near)


def _slope(level: SingleArray, voxel: FloatArray) -> float:
    """Mean slope per mm of a field (S, I, J) where it changes its sign between pixels of a slice."""
    axes = [axis for axis in range(3) if level.shape[axis] > 1]
    steep = np.linalg.norm([np.gradient(level, voxel[axis], axis=axis) for axis in axes], axis=0)
    inside = level <= 0
    crossing = np.zeros(level.shape, bool)
    crossing[:, 1:] |= inside[:, 1:] != inside[:, :-1]
    crossing[:, :, 1:] |= inside[:, :, 1:] != inside[:, :, :-1]
    return max(float(steep[crossing].mean()), 1e-6) if crossing.any() else 1.0
