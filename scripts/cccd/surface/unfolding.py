"""Limit surfaces that fold over themselves: their control points give way."""

from __future__ import annotations

import numpy as np

from cccd.geometry.arrays import BoolArray, FloatArray
from cccd.geometry.subdivision import Sampler

#: Triangles that a fold turned over have at least this share of the median one's area in the end.
LEAST_AREA = 0.01
#: Moves that unfold it, at most: what folds after these has, as a rule, a rim that crosses itself.
MOVES = 30


def unfold(points: FloatArray, sampler: Sampler, moving: BoolArray, normals: FloatArray) -> FloatArray:
    """Move control points where triangles of the limit surface face away from where they should.

    Areas are those seen along the normals; the squared lack of area of all triangles that have less than some
    is minimized.

    Parameters
    ----------
    points : (P, 3) float64
    sampler : Sampler
        Of the surface.
    moving : (P,) bool
        Points that may move.
    normals : (T, 3) float64
        Where the sampler's triangles should face.

    Returns
    -------
    (P, 3) float64
    """
    moved, count = points.copy(), sampler.matrix.shape[0]
    near = (sampler.matrix @ moving.astype(float) > 0)[sampler.triangles].any(axis=1)
    triangles, facing = sampler.triangles[near], normals[near, None]

    def areas(samples: FloatArray) -> tuple[FloatArray, FloatArray]:
        corners = samples[triangles]
        across = np.cross(np.roll(corners, 1, axis=1) - np.roll(corners, -1, axis=1), facing)
        return -(corners * across).sum(axis=(1, 2)) / 4, across

    area, _ = areas(sampler.matrix @ points)
    least = LEAST_AREA * float(np.median(area)) if len(area) else 0.0
    if least <= 0 or area.min() >= least:
        return points

    def lack(places: FloatArray) -> tuple[float, FloatArray]:
        moved[moving] = places.reshape(-1, 3)
        area, across = areas(sampler.matrix @ moved)
        missing = np.maximum(1 - area / least, 0.0)
        slope = (missing / least)[:, None, None] * across
        at = triangles.ravel()
        each = [np.bincount(at, slope[..., axis].ravel(), count) for axis in range(3)]
        return float(missing @ missing), (sampler.matrix.T @ np.column_stack(each))[moving].ravel()

    from scipy.optimize import minimize  # a hundred modules, and few surfaces fold

    found = minimize(lack, points[moving].ravel(), jac=True, method="L-BFGS-B", options={"maxiter": MOVES})
    moved[moving] = found.x.reshape(-1, 3)
    return moved
