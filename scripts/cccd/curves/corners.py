"""Corners of chains: the paper's k-cosine (equations 4-5, Definition 3), and those that a spline should keep.

Both accept ragged closed curves, work on all points at once and return a bool per point.
"""

from __future__ import annotations

from typing import cast

import numpy as np

from cccd.geometry.arrays import BoolArray, FloatArray, IntArray
from cccd.tolerances import ROUNDING

#: Which extremum of the k-cosine is a corner. The cosine is -1 on a straight line and +1 at a spike.
CRITERIA = ("max", "min")

# Sharp corners: arms so long in pixels, as shorter ones are straight on any digitised curve; their pixels lie
# so near to a straight line, which its digitisation leaves by no more; and they turn by so much, as blunter
# corners need no triple knot to stay within the tolerance.
_ARM_PX = 6
_STRAIGHT_PX = 0.5
_TURN_DEG = 60.0


class Ring:
    """Index arithmetic modulo each curve's length, for all points of ragged closed curves at once."""

    def __init__(self, offsets: IntArray):
        sizes = np.diff(offsets)
        self.size = np.repeat(sizes, sizes)
        self.begin = np.repeat(offsets[:-1], sizes)
        self.rank = np.arange(int(offsets[-1])) - self.begin

    def at(self, shift: int) -> np.ndarray:
        """Index (P,) of the point ``shift`` places further along the same curve."""
        return self.begin + (self.rank + shift) % self.size


def local_extrema(values: np.ndarray, reach: np.ndarray, ring: Ring) -> np.ndarray:
    """Where a value is the largest within ``reach`` places; of equals the first along the chain."""
    peak = np.ones(len(values), bool)
    for shift in range(1, int(reach.max(initial=0)) + 1):
        within = (shift <= reach) & (2 * shift <= ring.size)
        peak &= ~within | ((values >= values[ring.at(shift)]) & (values > values[ring.at(-shift)]))
    return peak


def k_cosine(
    points: np.ndarray, offsets: np.ndarray, largest: np.ndarray | int
) -> tuple[np.ndarray, np.ndarray]:
    """k-cosine of every point at its own support k (equations 4-5, Definition 3).

    Parameters
    ----------
    points : (P, 2) array
    offsets : (C + 1,) int array
    largest : int or (C,) int array
        m of Definition 3: the support is sought from m downwards.

    Returns
    -------
    cosine : (P,) float array
        c_ik: -1 where the curve is straight, towards +1 the sharper it turns.
    support : (P,) int array
        The selected k.

    Notes
    -----
    The chain ``c_im < c_im-1 < ... < c_ik`` of Definition 3 goes on while a shorter arm gives a larger
    cosine; k is where it ends. Arms never reach round more than half the curve.
    """
    ring = Ring(offsets)
    m = np.broadcast_to(np.asarray(largest), len(offsets) - 1)
    m = np.repeat(np.maximum(np.minimum(m, (np.diff(offsets) - 1) // 2), 1), np.diff(offsets))
    support, cosine = m.copy(), np.full(len(points), -1.0)
    descending = np.zeros(len(points), bool)
    for k in range(int(m.max(initial=0)), 0, -1):
        ahead, behind = points - points[ring.at(k)], points - points[ring.at(-k)]  # eq. (4)
        length = np.linalg.norm(ahead, axis=1) * np.linalg.norm(behind, axis=1)
        product = (ahead * behind).sum(axis=1)
        value = np.divide(product, length, out=np.full(len(points), -1.0), where=length > 0)  # eq. (5)
        rises = descending & (value - cosine > ROUNDING)
        take = rises | (m == k)
        cosine = np.where(take, value, cosine)
        support = np.where(take, k, support)
        descending = take
    return cosine, support


def k_cosine_corners(points: np.ndarray, offsets: np.ndarray, k: int, criterion: str = "max") -> np.ndarray:
    """Corners of Definition 3: extrema of the k-cosine within half their support.

    Parameters
    ----------
    points : (P, 2) array
    offsets : (C + 1,) int array
    k : int
        The paper's k: the longest support that is tried.
    criterion : {"max", "min"}
        ``"max"`` takes the sharpest points (Rosenfeld and Johnston), ``"min"`` the straightest, which the
        paper tries as well. Of equal values in a row the first counts.

    Returns
    -------
    (P,) bool array
    """
    if criterion not in CRITERIA:
        raise ValueError(f"criterion {criterion!r} is neither 'max' nor 'min'")
    cosine, support = k_cosine(points, offsets, k)
    values = cosine if criterion == "max" else -cosine
    return local_extrema(np.round(values, 12), support // 2, Ring(offsets))


def sharp_corners(points: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """Points (P,) bool where two straight arms meet at an angle: corners that a spline should keep.

    A round outline passes only where its radius is below the arms' length.
    """
    ring = Ring(offsets)
    backward, straight_behind = _arm(points, ring, -_ARM_PX)
    forward, straight_ahead = _arm(points, ring, _ARM_PX)
    cosine = np.clip(-(forward * backward).sum(axis=1), -1, 1)
    turn = cast(FloatArray, np.round(np.degrees(np.arccos(cosine)), 9))
    turn[~straight_behind | ~straight_ahead | (ring.size < 4 * _ARM_PX)] = 0
    return local_extrema(turn, np.full(len(points), _ARM_PX), ring) & (turn >= _TURN_DEG)


def _arm(points: FloatArray, ring: Ring, links: int) -> tuple[FloatArray, BoolArray]:
    """Direction (P, 2) of the line through an arm's points, outwards, and whether they lie straight."""
    shifts = [ring.at(int(np.sign(links)) * step) for step in range(abs(links) + 1)]
    centre = sum(points[shift] for shift in shifts) / len(shifts)
    xx, xy, yy = np.zeros((3, len(points)))
    for shift in shifts:
        x, y = (points[shift] - centre).T
        xx, xy, yy = xx + x * x, xy + x * y, yy + y * y
    angle = np.arctan2(2 * xy, xx - yy) / 2
    direction = np.column_stack([np.cos(angle), np.sin(angle)])
    outwards = ((points[shifts[-1]] - points) * direction).sum(axis=1) >= 0
    direction = np.where(outwards[:, None], direction, -direction)
    normal = direction[:, ::-1] * (-1, 1)
    deviation = np.zeros(len(points))
    for shift in shifts:
        deviation = np.maximum(deviation, np.abs(((points[shift] - centre) * normal).sum(axis=1)))
    return direction, deviation <= _STRAIGHT_PX
