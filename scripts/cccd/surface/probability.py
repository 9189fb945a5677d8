"""Where probabilities are known: distances to their level of one half, below the pixel."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from cccd.containers import Frame, ProbabilityStack
from cccd.geometry.arrays import FloatArray, IntArray, SingleArray

__all__ = ["distances_of_probabilities"]

#: So far from one half probabilities begin to be certain: distances to the slices' contours take over.
CERTAIN = (0.25, 0.45)


def distances_of_probabilities(
    stack: ProbabilityStack, frame: Frame, origin: IntArray, z: FloatArray, contours: SingleArray
) -> SingleArray:
    """Distances to where probabilities are one half, linear between their voxels.

    Near that level the distance is the probability's difference from one half by its mean slope; where
    probabilities are certain it is that to the slices' contours, with the sign of the probabilities.

    Parameters
    ----------
    stack : ProbabilityStack
    frame : Frame
        Of the source volume.
    origin : (2,) int64
        Source ``(i, j)`` of the levels' first pixel.
    z : (L,) float64
        Heights of the levels in mm.
    contours : (L, I, J) float32
        Distances in mm to the slices' contours, negative inside.
    """
    level = np.float32(0.5) - stack.values.astype(np.float32)
    slope = _slope(level, np.array([frame.slice_spacing, *frame.pixel_spacing]))
    first = np.asarray(stack.origin, np.int64)
    places: FloatArray = np.indices((1, *contours.shape[1:])).astype(float)
    places[1:] += (origin - first[1:])[:, None, None, None]
    out = np.empty_like(contours)
    for number, height in enumerate(z / frame.slice_spacing - first[0]):
        places[0] = height
        values = ndimage.map_coordinates(level, places, np.float32, order=1, mode="grid-constant", cval=0.5)[
            0
        ]
        near, far = values / np.float32(slope), contours[number]
        share = np.clip((np.abs(values) - CERTAIN[0]) / (CERTAIN[1] - CERTAIN[0]), 0, 1)
        certain = np.copysign(np.maximum(np.abs(far), np.abs(near)), values)
        out[number] = near + share * (certain - near)
    return out


def _slope(level: SingleArray, voxel: FloatArray) -> float:
    """Mean slope per mm of a field (S, I, J) where it changes its sign between pixels of a slice."""
    axes = [axis for axis in range(3) if level.shape[axis] > 1]
    steep = np.linalg.norm([np.gradient(level, voxel[axis], axis=axis) for axis in axes], axis=0)
    inside = level <= 0
    crossing = np.zeros(level.shape, bool)
    crossing[:, 1:] |= inside[:, 1:] != inside[:, :-1]
    crossing[:, :, 1:] |= inside[:, :, 1:] != inside[:, :, :-1]
    return max(float(steep[crossing].mean()), 1e-6) if crossing.any() else 1.0
