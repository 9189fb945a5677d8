"""Which points of neighbouring sections belong together, so that a tube neither twists nor shears."""

from __future__ import annotations

from typing import cast

import numpy as np
from scipy.ndimage import uniform_filter1d

from cccd.geometry._jit import jit
from cccd.geometry.arrays import FloatArray
from cccd.geometry.polygons import resample
from cccd.settings.surface import FittingSettings
from cccd.surface.tubes import Tube

__all__ = ["align", "at_fractions", "outward_normals"]

#: Every how many-th sample is matched with the neighbouring section; the others lie evenly between.
MATCH_EVERY = 4


def align(tube: Tube, count: int, settings: FittingSettings) -> tuple[FloatArray, FloatArray]:
    """Sample a tube's sections and find corresponding points on them.

    From the longest section, whose samples are evenly spread, matches run up and down the tube: each
    point goes to the nearest point of the next section that faces the same way. The order around the
    ring is kept, and the spacing relaxes, so that where a lobe grows the points spread into it while
    those elsewhere stay where they are.

    Returns
    -------
    rings : (A, count, 2) float64
        Sections in mm at equal steps of arc length.
    position : (A, count) float64
        Fractions of the way around each section, ascending: column m is one line along the tube.
    """
    rings = np.stack([resample(section.points, count) for section in tube.sections])
    normals = outward_normals(rings)
    length = np.sum(np.linalg.norm(np.roll(rings, -1, axis=1) - rings, axis=2), axis=1)
    start = int(np.argmax(length))
    coarse = np.arange(0, count, MATCH_EVERY) / count
    matches = np.empty((len(rings), len(coarse)))
    matches[start] = coarse
    for step, stop in ((1, len(rings)), (-1, -1)):
        for n in range(start + step, stop, step):
            here = np.array([n - step])
            known = matches[n - step][None]
            points = at_fractions(rings[here], known)[0]
            facing = at_fractions(normals[here], known)[0]
            radius = length[n] / (2 * np.pi)
            found = _nearest(points, facing, rings[n], normals[n], settings.facing_weight * radius**2)
            matches[n] = _ordered(found / count, settings.relaxation, settings.evening)
    inner = np.arange(count) / count
    position = np.stack(
        [np.interp(inner, np.append(coarse, 1.0), np.append(row, row[0] + 1)) for row in matches]
    )
    return rings, position


@jit
def at_fractions(rings: FloatArray, position: FloatArray) -> FloatArray:
    """Points at fractions (A, m) of the way around rings (A, M, 2) that are evenly sampled."""
    count = rings.shape[1]
    points = np.empty((*position.shape, 2))
    for a in range(position.shape[0]):
        for m in range(position.shape[1]):
            place = (position[a, m] - np.floor(position[a, m])) * count
            low = int(place)
            share = place - low
            low %= count
            high = (low + 1) % count
            for c in range(2):
                points[a, m, c] = (1 - share) * rings[a, low, c] + share * rings[a, high, c]
    return points


def outward_normals(rings: FloatArray) -> FloatArray:
    """Outward unit normals (A, M, 2) of counter-clockwise rings; zero where a ring is a point."""
    tangent = np.roll(rings, -2, axis=1) - np.roll(rings, 2, axis=1)
    size = np.linalg.norm(tangent, axis=2, keepdims=True)
    tangent = np.divide(tangent, size, out=np.zeros_like(tangent), where=size > 1e-9)
    return np.stack([tangent[..., 1], -tangent[..., 0]], axis=2)


@jit
def _nearest(
    points: FloatArray, facing: FloatArray, ring: FloatArray, normals: FloatArray, weight: float
) -> FloatArray:
    """For each point the sample (m,) of a ring that is nearest and faces the same way, with fraction."""
    count = len(ring)
    found = np.empty(len(points))
    cost = np.empty(count)
    for p in range(len(points)):
        best = 0
        for n in range(count):
            dx, dy = ring[n, 0] - points[p, 0], ring[n, 1] - points[p, 1]
            turn = 1.0 - normals[n, 0] * facing[p, 0] - normals[n, 1] * facing[p, 1]
            cost[n] = dx * dx + dy * dy + weight * turn
            if cost[n] < cost[best]:
                best = n
        before, after = cost[best - 1], cost[(best + 1) % count]
        curve = before - 2 * cost[best] + after
        found[p] = best + (0.5 * (before - after) / curve if curve > 0 else 0.0)
    return found


def _ordered(found: FloatArray, relaxation: float, evening: float) -> FloatArray:
    """Turn fractions (m,) into ascending ones around the ring, near to them, with relaxed spacing."""
    count = len(found)
    even = np.arange(count) / count
    shift = complex(np.exp(2j * np.pi * (found - even)).mean())
    turn = float(np.angle(shift)) / (2 * np.pi)
    ahead = np.mod(found - even - turn + 0.5, 1.0) - 0.5
    nearest = even + turn + ahead
    round_trip = np.concatenate([nearest - 1, nearest, nearest + 1])
    rising = np.maximum.accumulate(round_trip)
    falling = np.minimum.accumulate(round_trip[::-1])[::-1]
    line = ((rising + falling) / 2)[count : 2 * count]
    gaps = np.diff(np.append(line, line[0] + 1))
    relaxed = cast(FloatArray, uniform_filter1d(gaps, 9, mode="wrap"))
    gaps = (1 - relaxation - evening) * gaps + relaxation * relaxed + evening / count
    moved = cast(FloatArray, np.concatenate([[0.0], np.cumsum(gaps)[:-1]]) / gaps.sum())
    return moved + float(np.mean(line - moved))
