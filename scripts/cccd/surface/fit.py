"""Tensor-product fit of one tube: as few control points as a tolerance allows.

The sections of a tube are sampled on a grid (levels x points around), so least squares separates into
one small system per direction. Parameters around are corrected by moving every sample to the foot of
the fitted point on its section; areas, which least squares shrinks, are restored section by section.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d, maximum_filter1d, uniform_filter1d

from cccd.surface.alignment import align, at_fractions, outward_normals
from cccd.surface.bsplines import DEGREE, basis, closed_knots, least_squares, open_knots
from cccd.surface.guide import Guide
from cccd.surface.tubes import Tube

__all__ = ["Fit", "Samples", "even_size", "fit_samples", "refinements", "sample_tube", "sampled_area"]

#: Bends shorter than about six times this many pixels are noise of the pixels and are smoothed away ...
SMOOTHING_PIXELS = 0.6
#: ... by a penalty on bends of the control net, whose least weight settles what no sample speaks for.
LEAST_ROUGHNESS = 1e-3
#: Fewest control points around and along a tube.
FEWEST = (6, 4)
#: Control nets grow by this factor in one direction at a time.
GROWTH = 1.25
#: Samples further than this from the organ's boundary lie inside another tube; how much those count.
HIDDEN_PIXELS, HIDDEN_COUNTS = 1.5, 0.05
#: Where matched points of neighbouring sections lie this far apart no spline follows without ringing.
JUMP_PIXELS = 8.0
#: Rounds of parameter and area correction.
CORRECTIONS = 3


@dataclass(eq=False)
class Samples:
    """A tube as a grid of samples.

    Attributes
    ----------
    outlines : (A, M, 2)
        mm; sections at equal steps of arc length.
    position : (A, M)
        Fractions of the way around each section that correspond to each other.
    z, v, area : (A,)
        Heights in mm, parameter along the tube (mm of surface), area that each section stands for.
    normal : (A, M, 2)
        The surface's outward normal, split into its part in the plane (1 on a vertical wall) and along z.
    pole : list of (3,) or None
        Where the ends close.
    counts : (A, M)
        How much each sample matters: less where other tubes or a blend hide the surface.
    jumps : (P, 3)
        mm; points between sections, along the lines where the tube jumps from one to the next.
    pixel : float
        mm.
    """

    outlines: np.ndarray
    position: np.ndarray
    z: np.ndarray
    v: np.ndarray
    area: np.ndarray
    normal: np.ndarray
    pole: list[np.ndarray | None]
    counts: np.ndarray
    jumps: np.ndarray
    pixel: float


@dataclass(eq=False)
class Fit:
    """Control net of one tube in the plane's mm: ``net`` (nu, nv, 2), heights (nv,), and its error."""

    net: np.ndarray
    heights: np.ndarray
    knots_u: np.ndarray
    knots_v: np.ndarray
    error: float

    @property
    def count(self) -> int:
        """Number of control points."""
        return self.net.shape[0] * self.net.shape[1]


def sample_tube(tube: Tube, count: int, guide: Guide, pixel: float, reach: float) -> Samples:
    """Sample every section at ``count`` points and lay the parameter along the tube.

    Samples that are not on the guide's zero level, within a pixel or two, and those within ``reach`` mm
    of such ones, are hidden in the end; so are those beside a jump.
    """
    rings, position = align(tube, count)
    matched = at_fractions(rings, position)
    z = np.array([section.z for section in tube.sections])
    area = np.array([section.area for section in tube.sections])
    low, high = tube.pole
    closed = [np.full((1, count, 2), low[:2])] if low is not None else []
    closed += [matched]
    closed += [np.full((1, count, 2), high[:2])] if high is not None else []
    heights = np.concatenate([[] if low is None else low[2:], z, [] if high is None else high[2:]])
    every = np.concatenate(closed)
    outwards = outward_normals(every)
    moved = np.abs(np.sum(np.diff(every, axis=0) * (outwards[1:] + outwards[:-1]) / 2, axis=2))
    for row, cap in ((0, low), (-1, high)):
        if cap is not None:  # a pole has no normal: its neighbours travel all the way to it
            moved[row] = np.linalg.norm(every[row] - every[1 if row == 0 else -2], axis=1)
    travelled = np.hypot(np.diff(heights), np.median(moved, axis=1))
    v = np.concatenate([[0.0], np.cumsum(np.maximum(travelled, 1e-6))])
    inner = slice(low is not None, len(every) - (high is not None))
    run = np.sum(np.gradient(every, axis=0) * outwards, axis=2)
    climb = np.broadcast_to(np.gradient(heights)[:, None], run.shape)
    normal = np.stack([climb, -run], axis=2) / np.maximum(np.hypot(climb, run), 1e-9)[..., None]
    counts = np.ones(run[inner].shape)
    lines = np.dstack([matched, np.broadcast_to(z[:, None], counts.shape)])
    step = np.linalg.norm(np.diff(matched, axis=0), axis=2)
    jump = step > JUMP_PIXELS * pixel
    jumps = _between(lines[:-1][jump], lines[1:][jump], step[jump], reach / 2)
    samples = Samples(rings, position, z, v, area, normal[inner], tube.pole, counts, jumps, pixel)
    counts[_hidden(samples, lines, guide, reach)] = HIDDEN_COUNTS
    counts[1:][jump] = counts[:-1][jump] = HIDDEN_COUNTS
    return samples


def _between(start: np.ndarray, end: np.ndarray, length: np.ndarray, apart: float) -> np.ndarray:
    """Points (P, 3) inside segments from ``start`` to ``end`` (J, 3), no further ``apart`` than that."""
    pieces = np.ceil(length / apart).astype(np.int64)
    segment = np.repeat(np.arange(len(length)), pieces)
    share = (np.arange(len(segment)) - np.repeat(np.cumsum(pieces) - pieces, pieces) + 0.5) / pieces[segment]
    return start[segment] + share[:, None] * (end - start)[segment]


def _hidden(samples: Samples, points: np.ndarray, guide: Guide, reach: float) -> np.ndarray:
    """Tell which samples, at points (A, M, 3), end up below the surface, or in a blend."""
    distance, room = guide(points.reshape(-1, 3), -np.inf)
    away = (np.abs(distance) > HIDDEN_PIXELS * samples.pixel) & (room > 0)
    away = away.reshape(points.shape[:2])
    if not away.any():
        return away
    along = np.median(np.gradient(_inner(samples))) if len(samples.z) > 1 else np.inf
    around = np.median(_lengths(samples.outlines)) / points.shape[1]
    rows, columns = int(reach / along), min(int(reach / around), points.shape[1] // 2)
    near = maximum_filter1d(away, 2 * columns + 1, axis=1, mode="wrap")
    return maximum_filter1d(near, 2 * rows + 1, axis=0, mode="nearest")


def _areas(rings: np.ndarray) -> np.ndarray:
    following = np.roll(rings, -1, axis=1)
    return 0.5 * np.sum(rings[..., 0] * following[..., 1] - rings[..., 1] * following[..., 0], axis=1)


def _lengths(rings: np.ndarray) -> np.ndarray:
    return np.sum(np.linalg.norm(np.roll(rings, -1, axis=1) - rings, axis=2), axis=1)


def even_size(samples: Samples, count: float) -> tuple[int, int]:
    """Size of a control net of about ``count`` points with equal spacing in both directions."""
    around = float(np.mean(_lengths(samples.outlines)))
    spacing = np.sqrt(around * samples.v[-1] / max(count, 1.0))
    sizes = np.array([around / spacing, samples.v[-1] / spacing + DEGREE])
    return tuple(int(size) for size in np.clip(np.rint(sizes), FEWEST, _most(samples)))


def _most(samples: Samples) -> tuple[int, int]:
    """Size of the largest control net that the samples determine."""
    return samples.outlines.shape[1] // 2, len(samples.z) + DEGREE


def refinements(size: tuple[int, int], samples: Samples, room: float) -> list[tuple[int, int]]:
    """List the next larger control nets worth a trial, of at most ``room`` more points: around, or along."""
    nu, nv = size
    most = _most(samples)
    around = min(int(np.ceil(nu * GROWTH)), most[0], nu + int(room / nv))
    along = min(int(np.ceil(nv * GROWTH)), most[1], nv + int(room / nu))
    return [trial for trial in ((max(nu, around), nv), (nu, max(nv, along))) if trial != size]


def fit_samples(samples: Samples, size: tuple[int, int], corrections: int = CORRECTIONS) -> Fit:
    """Fit a control net of ``size`` (nu, nv) to the samples.

    Returns
    -------
    Fit
        Its error is the mean distance in mm between sections and surface, in direction of the
        surface normal.
    """
    nu, nv = size
    rings = samples.outlines
    levels, around = rings.shape[:2]
    length = float(samples.v[-1])
    knots_u, knots_v = closed_knots(nu), open_knots(nv, length)
    u = np.arange(around) / around
    bu = basis(u, knots_u, DEGREE, True)
    to_u = least_squares(bu, _roughness(samples, np.mean(_lengths(rings)) / nu), True)
    heights = _heights(samples, knots_v)
    bv = basis(_inner(samples) + _lateness(samples, heights, knots_v), knots_v, DEGREE, False)
    fixed = np.zeros(nv, bool)
    known = np.zeros((nv, 2))
    for row, pole in zip((0, nv - 1), samples.pole, strict=True):
        if pole is not None:
            fixed[row], known[row] = True, pole[:2]
    base = (bv[:, fixed] @ known[fixed])[:, None]
    to_v = least_squares(bv[:, ~fixed], _roughness(samples, length / (nv - DEGREE)), False)

    position = samples.position
    swell = np.zeros(levels)
    normals = outward_normals(rings)
    fitted = at_fractions(rings, position)
    for turn in range(corrections + 1):
        target = at_fractions(rings, position) + swell[:, None, None] * at_fractions(normals, position)
        # What is hidden may go where the rest wants it.
        target = np.where(samples.counts[..., None] < 1, fitted, target)
        free = _in_both(to_v, to_u, target - base)
        net = np.empty((nu, nv, 2))
        net[:, fixed] = known[fixed]
        net[:, ~fixed] = free
        fitted = _in_both(bu, bv, net)
        if turn < corrections:
            position = _feet(rings, position, fitted)
            swell = swell + _missing(samples, fitted, nv)
    error = _error(samples, normals, position, fitted, bv @ heights)
    return Fit(net, heights, knots_u, knots_v, error)


def _in_both(first: np.ndarray, second: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Apply one operator (p, a) along the first axis of ``values`` (a, b, c), another (q, b) along the next.

    The result (q, p, c) has the axes swapped.
    """
    return np.tensordot(second, np.tensordot(first, values, 1), (1, 1))


def _roughness(samples: Samples, knot: float) -> float:
    """Weight of the penalty on the second differences of control points ``knot`` mm apart.

    Least squares with it let waves of length w pass by 1 / (1 + (2 pi SMOOTHING_PIXELS pixels / w)^4).
    """
    return max(LEAST_ROUGHNESS, (SMOOTHING_PIXELS * samples.pixel / knot) ** 4)


def _inner(samples: Samples) -> np.ndarray:
    """Parameters of the sections, without the poles."""
    low, high = (pole is not None for pole in samples.pole)
    return samples.v[int(low) : len(samples.v) - int(high)]


def _heights(samples: Samples, knots_v: np.ndarray) -> np.ndarray:
    """Heights of the control rows, never falling.

    A row of control points has one height, so every iso-curve around the tube is plane. Next to a
    pole two rows share the height: the tangent plane there is level and the end is round.
    """
    count = len(knots_v) - DEGREE - 1
    low, high = samples.pole
    z = np.concatenate([[] if low is None else low[2:], samples.z, [] if high is None else high[2:]])
    bv = basis(samples.v, knots_v, DEGREE, False)
    ends = [(0, z[0]), (count - 1, z[-1])]
    ends += [] if low is None else [(1, z[0])]
    ends += [] if high is None else [(count - 2, z[-1])]
    known = np.zeros(count)
    fixed = np.zeros(count, bool)
    for row, value in ends:
        known[row], fixed[row] = value, True
    heights = known.copy()
    if not fixed.all():
        heights[~fixed] = least_squares(bv[:, ~fixed], LEAST_ROUGHNESS, False) @ (z - bv @ known)
    return np.clip(np.maximum.accumulate(heights), z[0], z[-1])


def _lateness(samples: Samples, heights: np.ndarray, knots_v: np.ndarray) -> np.ndarray:
    """How much later in v (A,) each section's height is reached; at most half a knot interval."""
    length = knots_v[-1]
    fine = np.linspace(0, length, 16 * len(heights))
    climbed = basis(fine, knots_v, DEGREE, False) @ heights
    reached = np.interp(samples.z, climbed + 1e-9 * fine, fine)
    limit = length / (2 * (len(heights) - DEGREE))
    return np.clip(reached - _inner(samples), -limit, limit)


def _feet(rings: np.ndarray, position: np.ndarray, fitted: np.ndarray) -> np.ndarray:
    """Move each sample along its section towards the foot of its fitted point.

    One tangential Newton step, smoothed around the ring and kept short enough to preserve the order.
    """
    count = rings.shape[1]
    ahead, behind = at_fractions(rings, position + 1 / count), at_fractions(rings, position - 1 / count)
    tangent = (ahead - behind) * (count / 2)
    lag = np.sum((fitted - at_fractions(rings, position)) * tangent, axis=2)
    move = lag / np.maximum(np.sum(tangent**2, axis=2), 1e-12)
    move = uniform_filter1d(np.clip(move, -0.1, 0.1), max(3, count // 32), axis=1, mode="wrap")
    gap = np.roll(position, -1, axis=1) - position
    gap[:, -1] += 1.0
    shrink = np.roll(move, -1, axis=1) - move
    worst = np.max(-shrink / np.maximum(gap, 1e-9), axis=1, keepdims=True)
    return position + move * np.minimum(1.0, 0.5 / np.maximum(worst, 1e-9))


def _missing(samples: Samples, fitted: np.ndarray, rows: int) -> np.ndarray:
    """How far each section must move outwards in mm to regain the volume around it.

    Volume is balanced over the reach of a control row, so that where the surface bridges a jump of the
    outline no lip runs around it; and by a sample's spacing at most.
    """
    window = max(1, round(2 * len(samples.z) / rows))
    thickness = np.gradient(samples.z) if len(samples.z) > 1 else np.ones(1)

    def spread(value: np.ndarray) -> np.ndarray:
        return gaussian_filter1d(value * thickness, window, mode="nearest")

    lengths = _lengths(fitted)
    step = spread(samples.area - _areas(fitted)) / np.maximum(spread(lengths), 1e-9)
    limit = lengths / samples.outlines.shape[1]
    return np.clip(step, -limit, limit)


def _error(
    samples: Samples, normals: np.ndarray, position: np.ndarray, fitted: np.ndarray, heights: np.ndarray
) -> float:
    """Mean distance in mm between sections and surface along the surface's normal, by area."""
    rings = samples.outlines
    away = np.sum((fitted - at_fractions(rings, position)) * at_fractions(normals, position), axis=2)
    lifted = (heights - samples.z)[:, None]
    distance = np.abs(away * samples.normal[..., 0] + lifted * samples.normal[..., 1])
    return float(np.average(distance, weights=samples.counts * _strips(samples)))


def _strips(samples: Samples) -> np.ndarray:
    """Area in mm^2 of the surface that each sample (A, M) speaks for."""
    along = np.gradient(_inner(samples)) if len(samples.z) > 1 else np.ones(1)
    around = _lengths(samples.outlines) / samples.outlines.shape[1]
    return np.repeat((along * around)[:, None], samples.outlines.shape[1], axis=1)


def sampled_area(samples: Samples) -> float:
    """Area in mm^2 of the tube's surface between its sections."""
    return float((samples.counts * _strips(samples)).sum())
