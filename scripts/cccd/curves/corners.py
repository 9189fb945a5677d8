"""Corner detectors on chains: the paper's k-cosine (equations 4-5, Definition 3), and section 2's baselines.

Every detector accepts ragged closed curves, works on all points at once and returns a bool per point.
Directions are Freeman codes where the curve is a pixel chain; on other polygons they are real numbers in
the same unit of 45 degrees, so nothing here needs a pixel grid.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from cccd.geometry.arrays import predecessors, successors
from cccd.tolerances import ROUNDING, STILL

__all__ = [
    "CRITERIA",
    "DETECTORS",
    "Ring",
    "beus_tiu",
    "cheng_hsu",
    "k_cosine",
    "k_cosine_corners",
    "local_extrema",
    "medioni_yasumoto",
    "rosenfeld_johnston",
    "sharp_corners",
    "weighted_k_curvature",
]

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

    def __init__(self, offsets: np.ndarray):
        sizes = np.diff(offsets)
        self.size = np.repeat(sizes, sizes)
        self.begin = np.repeat(offsets[:-1], sizes)
        self.rank = np.arange(offsets[-1]) - self.begin
        self.longest = int(sizes.max(initial=0))

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


# The paper's detector ---------------------------------------------------------------------------------


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


# Its baselines ----------------------------------------------------------------------------------------


def rosenfeld_johnston(points: np.ndarray, offsets: np.ndarray, share: float = 0.07) -> np.ndarray:
    """Rosenfeld and Johnston 1973: k-cosine maxima whose longest support is a share of the curve.

    The paper's reference [37], misspelt Rosenfeld-Johnson there. A straight stretch has no corner.
    """
    largest = np.maximum(np.rint(share * np.diff(offsets)), 2).astype(int)
    cosine, support = k_cosine(points, offsets, largest)
    rounded = np.round(cosine, 12)
    return local_extrema(rounded, support // 2, Ring(offsets)) & (rounded > -1)


def beus_tiu(
    points: np.ndarray,
    offsets: np.ndarray,
    shortest: int = 4,
    longest: int = 7,
    cut_off: float = 0.05,
    threshold: float = 300.0,
) -> np.ndarray:
    """Beus and Tiu 1987: Freeman and Davis' cornerity, averaged over k, with arms cut off.

    The cornerity at k is ``ln t1 * ln t2 * sum(delta)`` in degrees: the turning of the chord over k
    links, weighted by how far the curve runs straight before (t1) and after (t2); both are cut off at a
    share of the curve. Corners are maxima of its mean over k above a threshold. The default of 300 is our
    choice: what a turn of 60 degrees between straight arms of five pixels reaches. The 1500 that is usually
    quoted presumes arms that run straight far longer than an organ's do.
    """
    ring = Ring(offsets)
    limit = np.maximum(cut_off * ring.size, 1.0)
    cornerity = np.zeros(len(points))
    for k in range(shortest, longest + 1):
        chord = points - points[ring.at(-k)]
        angle = np.degrees(np.arctan2(-chord[:, 0], chord[:, 1]))
        delta = (angle[ring.at(1)] - angle[ring.at(-1)] + 180) % 360 - 180
        straight = np.abs(delta) < np.degrees(np.arctan(1 / (k - 1))) - ROUNDING
        before = np.minimum(_run_before(straight, offsets), limit)
        after = np.minimum(_run_before(straight, offsets, reverse=True), limit)[ring.at(k)]
        turning = sum(delta[ring.at(j)] for j in range(k + 1))
        arms = np.log(np.maximum(before, 1)) * np.log(np.maximum(after, 1))
        cornerity += np.abs(arms * turning)
    cornerity = np.round(cornerity / (longest - shortest + 1), 9)
    reach = np.full(len(points), longest + 1)
    return local_extrema(cornerity, reach, ring) & (cornerity > threshold)


def medioni_yasumoto(
    points: np.ndarray, offsets: np.ndarray, step: int = 3, displacement: float = 0.35
) -> np.ndarray:
    """Medioni and Yasumoto 1987: curvature of the B-spline whose control points are the chain's.

    At a knot the curve lies ``|P_{i-1} - 2 P_i + P_{i+1}| / 6`` from its control point. Corners are
    maxima of the curvature where that displacement exceeds a threshold in pixels. ``step`` is the
    distance along the chain of the three points used: neighbouring pixels would see the staircase only.
    Both defaults are our choice.
    """
    ring = Ring(offsets)
    ahead, behind = points[ring.at(step)], points[ring.at(-step)]
    bend = (behind - 2 * points + ahead) / 2
    speed = (ahead - behind) / 2
    cross = speed[:, 0] * bend[:, 1] - speed[:, 1] * bend[:, 0]
    cube = np.maximum((speed**2).sum(axis=1), STILL) ** 1.5
    curvature = np.round(2 * np.abs(cross) / cube, 12)
    moved = np.linalg.norm(bend, axis=1) / 3
    return local_extrema(curvature, np.full(len(points), step), ring) & (moved > displacement)


def weighted_k_curvature(
    points: np.ndarray, offsets: np.ndarray, k: int = 6, threshold: float = 1.0
) -> np.ndarray:
    """Weighted k-curvature: turning within k links, weighted by ``(1 - |j| / k)^2``, in units of 45 degrees.

    The plain k-curvature (difference of mean directions behind and ahead) has weights ``1 - |j| / k``.
    """
    ring = Ring(offsets)
    turn = _turning(points, offsets)
    bending = turn.copy()
    for j in range(1, k):
        bending += (1 - j / k) ** 2 * (turn[ring.at(j)] + turn[ring.at(-j)])
    bending = np.round(np.abs(bending), 12)
    return local_extrema(bending, np.full(len(points), k), ring) & (bending > threshold)


def cheng_hsu(
    points: np.ndarray, offsets: np.ndarray, k: int = 4, threshold: float | None = None
) -> np.ndarray:
    """Cheng and Hsu 1988: bending value from direction differences by additions only.

    A point where the direction changes is a corner when the differences of the directions j links ahead
    and j links behind, j = 1..k, add up to more than the threshold (default k: 45 degrees) and to no less
    than at any point within k. Chains here are simple, so that the published conditions on the number of
    neighbours always hold.
    """
    ring = Ring(offsets)
    direction = _directions(points, offsets)
    bending = np.zeros(len(points))
    for j in range(1, k + 1):
        difference = direction[ring.at(j - 1)] - direction[ring.at(-j)]
        bending += 4 - (4 - difference) % 8  # within (-4, 4]
    bending = np.round(np.abs(bending), 12)
    turns = np.abs(_turning(points, offsets)) > ROUNDING
    bending = np.where(turns, bending, 0)
    limit = float(k if threshold is None else threshold)
    return local_extrema(bending, np.full(len(points), k), ring) & (bending > limit)


# Sharp corners of the shape itself --------------------------------------------------------------------


def sharp_corners(points: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """Points (P,) bool where two straight arms meet at an angle: corners that a spline should keep.

    A round outline passes only where its radius is below the arms' length.
    """
    ring = Ring(offsets)
    backward, straight_behind = _arm(points, ring, -_ARM_PX, _STRAIGHT_PX)
    forward, straight_ahead = _arm(points, ring, _ARM_PX, _STRAIGHT_PX)
    cosine = np.clip(-(forward * backward).sum(axis=1), -1, 1)
    turn = np.round(np.degrees(np.arccos(cosine)), 9)
    reach = np.full(len(points), _ARM_PX)
    fits = straight_behind & straight_ahead & (ring.size >= 4 * _ARM_PX)
    turn = np.where(fits, turn, 0)
    return local_extrema(turn, reach, ring) & (turn >= _TURN_DEG)


def _arm(points: np.ndarray, ring: Ring, links: int, straight_px: float) -> tuple[np.ndarray, np.ndarray]:
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
    return direction, deviation <= straight_px


def _directions(points: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """Direction (P,) of each link in [0, 8): the Freeman code on a pixel chain."""
    step = points[successors(offsets)] - points
    return np.arctan2(-step[:, 0], step[:, 1]) / (np.pi / 4) % 8


def _turning(points: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """Return the turning (P,) at each point in units of 45 degrees, within [-4, 4)."""
    direction = _directions(points, offsets)
    return (direction - direction[predecessors(offsets)] + 4) % 8 - 4


def _run_before(flag: np.ndarray, offsets: np.ndarray, reverse: bool = False) -> np.ndarray:
    """How many consecutive points before each one (after it, in reverse) are flagged, round the curve."""
    ring = Ring(offsets)
    sizes = np.diff(offsets)
    twice = np.repeat(2 * offsets[:-1], 2 * sizes)  # every curve written down twice in a row
    rank = np.arange(2 * offsets[-1]) - twice
    source = np.repeat(offsets[:-1], 2 * sizes) + rank % np.maximum(np.repeat(sizes, 2 * sizes), 1)
    if reverse:
        source = source[::-1]
    place = np.arange(len(source))
    last = np.maximum.accumulate(np.where(flag[source], -1, place)) if len(source) else place
    run = np.zeros(len(flag), np.int64)
    # the second writing of a curve looks back over the whole of the first
    run[source] = np.minimum(np.concatenate([[0], place[:-1] - last[:-1]]), ring.size[source])
    return run


#: Detectors of section 2 by name: (points, offsets, **parameters) -> (P,) bool. Their defaults are what is
#: usually quoted; the publications could not be read, so none is said to be theirs.
DETECTORS: dict[str, Callable[..., np.ndarray]] = {
    "k-cosine": partial(k_cosine_corners, k=7),
    "Rosenfeld-Johnston": rosenfeld_johnston,
    "Beus-Tiu": beus_tiu,
    "Medioni-Yasumoto": medioni_yasumoto,
    "weighted k-curvature": weighted_k_curvature,
    "Cheng-Hsu": cheng_hsu,
}
