"""Smoothing of triangle meshes by a windowed sinc filter (Taubin, Zhang and Golub 1996)."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
from numpy.polynomial import chebyshev
from scipy.sparse import coo_array, csr_array

from cccd.geometry.arrays import BoolArray, FloatArray, IntArray
from cccd.tolerances import TINY

__all__ = ["low_passed"]

#: The window of Nuttall (1981), by its cosines: it keeps the size of what is smoothed.
_NUTTALL = (0.355768, 0.487396, 0.144232, 0.012604)
#: Waves at the end of the band keep their height up to this share.
_KEPT = 1e-3
#: Steps of Newton's search for that; it takes 20 to 40.
_STEPS = 500
#: Where an open edge bends by more, its vertex stays.
_RIM_DEG = 15.0


def low_passed(vertices: FloatArray, faces: IntArray, band: float, rounds: int) -> FloatArray:
    """Move vertices (V, 3) of a mesh; see `cccd.geometry.mesh.Mesh.low_passed`.

    As VTK's ``vtkWindowedSincPolyDataFilter`` does, but for rounding.
    """
    means = _means(vertices, faces)
    centre = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
    before = vertices - centre
    now = (before + means @ before) / 2
    first, second, *others = _weights(band, rounds)
    total = first * before + second * now
    for weight in others:  # Chebyshev's polynomials of the mean
        before, now = now, now - before + means @ now
        total += weight * now
    return total + centre


def _weights(band: float, rounds: int) -> FloatArray:
    """Weights (rounds + 1,) of Chebyshev's polynomials, of which the filter is made."""
    order = np.arange(rounds + 1)
    window = np.cos(np.outer(order, range(len(_NUTTALL))) * np.pi / (rounds + 1)) @ _NUTTALL
    end, shift, wave = float(np.arccos(1 - band / 2)), 0.0, 1 - band / 2
    weights: FloatArray = np.empty(0)
    for _ in range(_STEPS):
        weights = 2 * (end + shift) / np.pi * window * np.sinc(order * (end + shift) / np.pi)
        weights[0] /= 2
        off = _value(weights, wave) - 1
        if abs(off) < _KEPT or rounds < 2:
            break
        slope: FloatArray = cast(Any, chebyshev).chebder(weights[:-1])
        slope[0] *= 2  # VTK's: the search ends elsewhere with another
        shift -= off / _value(slope, wave)
    return weights


def _value(weights: FloatArray, at: float) -> float:
    """Evaluate a sum of Chebyshev's polynomials."""
    return float(cast(Any, chebyshev).chebval(at, weights))


def _means(vertices: FloatArray, faces: IntArray) -> csr_array:
    """Matrix (V, V) of the mean of each vertex's neighbours, on an open edge of the two along it.

    Itself it is where an edge has more than two triangles, where open edges meet or bend.
    """
    count = len(vertices)
    ends = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2)
    both = np.concatenate([ends, ends[:, ::-1]]).T
    links = coo_array((np.ones(both.shape[1]), both), shape=(count, count)).tocsr()
    start, end, triangles = np.repeat(np.arange(count), np.diff(links.indptr)), links.indices, links.data
    rims = np.bincount(start[triangles == 1], minlength=count)
    rim = triangles == 1
    along = vertices[end[rim]] - vertices[start[rim]]
    along /= np.linalg.norm(along, axis=1, keepdims=True) + TINY
    turn = np.stack([np.bincount(start[rim], part, count) for part in along.T], axis=1)
    straight = 1 - (turn**2).sum(axis=1) / 2 >= np.cos(np.radians(_RIM_DEG))
    moves = (rims == 0) | ((rims == 2) & straight)
    moves[start[triangles > 2]] = False
    used: BoolArray = moves[start] & (rim | (rims[start] == 0))
    stays = np.flatnonzero(~moves)
    start, end = np.concatenate([start[used], stays]), np.concatenate([end[used], stays])
    share = 1 / np.bincount(start, minlength=count).clip(1)
    return coo_array((share[start], (start, end)), shape=(count, count)).tocsr()
