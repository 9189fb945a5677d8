"""On which of its bodies, or where on its tubes, each vertex of a surface lies."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from cccd.geometry.arrays import FloatArray, IntArray
from cccd.geometry.bsplines import Patch
from cccd.geometry.subdivision import ControlMesh
from cccd.surface.surface import Surface

__all__ = ["TubeCoordinates", "body_numbers", "tube_coordinates"]

#: Bodies are subdivided so often where points look for the nearest.
SUBDIVIDED = 2
#: Samples around and along each control point of a tube.
PER_CONTROL_POINT = 4


class TubeCoordinates(NamedTuple):
    """Coordinates of points on the nearest of some tubes."""

    tube: IntArray  # (P,) its number
    around: FloatArray  # (P,) 0 to 1, once around the tube
    along: FloatArray  # (P,) 0 to 1, from its lower end to its upper
    distance: FloatArray  # (P,) mm to the tube, by its samples


def body_numbers(points: FloatArray, bodies: Sequence[ControlMesh]) -> IntArray:
    """Which of some bodies (P,) is the nearest, by their samples, to points (P, 3) in mm RAS."""
    samples = [body.tessellate(SUBDIVIDED).vertices for body in bodies]
    owner = np.repeat(np.arange(len(bodies)), [len(part) for part in samples])
    _, nearest = cKDTree(np.concatenate(samples)).query(points)
    return owner[nearest]


def tube_coordinates(points: FloatArray, surface: Surface) -> TubeCoordinates:
    """Coordinates of points (P, 3) in mm RAS on the tubes of a surface, which are those before blending.

    The nearest of samples between the control points is taken, four for each of them in both directions.
    """
    samples: list[FloatArray] = []
    numbers: list[IntArray] = []
    places: list[FloatArray] = []
    for number, patch in enumerate(surface.patches):
        around, along = _shares(patch)
        u, v = np.meshgrid(around, along, indexing="ij")
        ends = (_ends(patch.knots_u, patch.degree_u), _ends(patch.knots_v, patch.degree_v))
        at = [low + (high - low) * share.ravel() for (low, high), share in zip(ends, (u, v), strict=True)]
        samples.append(patch.evaluate(at[0], at[1]))
        numbers.append(np.full(u.size, number, np.int64))
        places.append(np.column_stack([u.ravel(), v.ravel()]))
    distance, nearest = cKDTree(np.concatenate(samples)).query(points)
    place = np.concatenate(places)[nearest]
    return TubeCoordinates(np.concatenate(numbers)[nearest], place[:, 0], place[:, 1], np.asarray(distance))


def _shares(patch: Patch) -> tuple[FloatArray, FloatArray]:
    """Shares of a patch's two parameters at its samples."""
    nu, nv = (PER_CONTROL_POINT * count for count in patch.weights.shape)
    around: FloatArray = np.arange(nu, dtype=float) / nu
    return around, np.linspace(0, 1, nv)


def _ends(knots: FloatArray, degree: int) -> tuple[float, float]:
    """First and last value of a parameter."""
    return float(knots[degree]), float(knots[-degree - 1])
