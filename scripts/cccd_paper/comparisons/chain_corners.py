"""Section 2's corner detectors on chains, and the paper's k-cosine beside them.

Every detector accepts ragged closed curves, works on all points at once and returns a bool per point.
Directions are Freeman codes where the curve is a pixel chain; on other polygons they are real numbers in
the same unit of 45 degrees, so nothing here needs a pixel grid.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from cccd.curves.corners import Ring, k_cosine, k_cosine_corners, local_extrema
from cccd.geometry.arrays import predecessors, successors
from cccd.tolerances import ROUNDING, STILL


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
