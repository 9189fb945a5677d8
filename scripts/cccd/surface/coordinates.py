"""On which of its bodies each vertex of a surface lies."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from cccd.geometry.arrays import FloatArray, IntArray
from cccd.geometry.subdivision import ControlMesh

__all__ = ["body_numbers"]

#: Bodies are subdivided so often where points look for the nearest.
SUBDIVIDED = 2


def body_numbers(points: FloatArray, bodies: Sequence[ControlMesh]) -> IntArray:
    """Which of some bodies (P,) is the nearest, by their samples, to points (P, 3) in mm RAS."""
    samples = [body.tessellate(SUBDIVIDED).vertices for body in bodies]
    owner = np.repeat(np.arange(len(bodies)), [len(part) for part in samples])
    _, nearest = cKDTree(np.concatenate(samples)).query(points)
    return owner[nearest]
