"""How far from a border a network's probabilities are not certain."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from cccd.containers import Frame, ProbabilityStack
from cccd.geometry.arrays import FloatArray, IntArray
from cccd.geometry.mesh import Mesh

__all__ = ["find_doubt"]

#: With it 90 % of the readers' borders lie within the bands of the shipped segmenter's hippocampi, ten of
#: those that it was not trained on.
FACTOR = 0.87
#: Doubt counts up to so many mm before the factor.
MOST_DOUBT = 20.0


def find_doubt(
    mesh: Mesh, stack: ProbabilityStack | None, frame: Frame, origin: IntArray, share: float
) -> FloatArray | None:
    """How far in mm (V,) from a mesh probabilities reach that are less certain than a share.

    They fall from one half by half the share over this distance, if they fall on as they do at the vertex.
    It is multiplied by `FACTOR`. A border that is sharp gives a doubt of three quarters of a voxel.

    Parameters
    ----------
    mesh : Mesh
        In the plane's mm and height.
    stack : ProbabilityStack or None
    frame : Frame
        Of the source volume.
    origin : (2,) int64
        Source ``(i, j)`` of the plane's first pixel.
    share : float
        Of the border that shall lie within.

    Returns
    -------
    (V,) float64 or None
        None without probabilities.
    """
    if stack is None:
        return None
    voxel, first = np.array([frame.slice_spacing, *frame.pixel_spacing]), np.asarray(stack.origin, np.int64)
    places = mesh.vertices[:, [2, 0, 1]] / voxel - first + np.array([0, *origin])
    axes = [axis for axis in range(3) if stack.values.shape[axis] > 1]
    slopes = [
        ndimage.map_coordinates(
            np.gradient(stack.values, voxel[axis], axis=axis), places.T, order=1, mode="nearest"
        )
        for axis in axes
    ]
    steep = np.maximum(np.linalg.norm(slopes, axis=0), share / (2 * MOST_DOUBT))
    return FACTOR * share / 2 / steep
