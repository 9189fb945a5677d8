"""Tensor-product fit of one tube by least squares, eq. (10).

The sections of a tube are sampled on a grid (levels x points around), so least squares separates into
one small system per direction. Parameters around are corrected by moving every sample to the foot of
the fitted point on its section; areas, which least squares shrinks, are restored section by section.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d, uniform_filter1d

from cccd.geometry.arrays import BoolArray, FloatArray
from cccd.geometry.bsplines import DEGREE, basis, closed_knots, open_knots, smoothing_operator
from cccd.surface.alignment import at_fractions, outward_normals
from cccd.surface.samples import Samples, lengths

__all__ = ["Fit", "fit_samples"]

#: Least weight of the penalty on bends of the control net: it settles what no sample speaks for.
LEAST_ROUGHNESS = 1e-3


@dataclass(frozen=True, eq=False)
class Fit:
    """Control net of one tube in the plane's mm.

    Attributes
    ----------
    net : (nu, nv, 2) float64
        Control points, around and along.
    heights : (nv,) float64
        Height of every row of them in mm.
    knots_u, knots_v
        Closed around, clamped along.
    error : float
        Mean distance in mm between sections and surface, in direction of the surface normal.
    """

    net: FloatArray
    heights: FloatArray
    knots_u: FloatArray
    knots_v: FloatArray
    error: float

    @property
    def count(self) -> int:
        """Number of control points."""
        return self.net.shape[0] * self.net.shape[1]


@dataclass(frozen=True, eq=False)
class _System:
    """Least squares of a control net of (nu, nv) points, one operator per direction.

    ``basis_u`` (M, nu) and ``basis_v`` (A, nv) lead from control points to samples, ``solve_u`` and
    ``solve_v`` from samples to control points. Rows of the net that are ``fixed`` (nv,) lie on a pole at
    ``known`` (nv, 2); ``heights`` (nv,) are all rows'.
    """

    knots_u: FloatArray
    knots_v: FloatArray
    basis_u: FloatArray
    basis_v: FloatArray
    solve_u: FloatArray
    solve_v: FloatArray
    fixed: BoolArray
    known: FloatArray
    heights: FloatArray

    @classmethod
    def of(cls, samples: Samples, size: tuple[int, int], smoothing_pixels: float) -> _System:
        nu, nv = size
        length, smoothing = float(samples.v[-1]), smoothing_pixels * samples.pixel
        knots_u, knots_v = closed_knots(nu), open_knots(nv, length)
        basis_u = basis(np.arange(samples.around) / samples.around, knots_u, DEGREE, True)
        knot_u = float(np.mean(lengths(samples.outlines))) / nu
        solve_u = smoothing_operator(basis_u, _roughness(smoothing, knot_u), True)
        heights = _row_heights(samples, knots_v)
        v = samples.section_v + _parameter_corrections(samples, heights, knots_v)
        basis_v = basis(v, knots_v, DEGREE, False)
        fixed = np.zeros(nv, bool)
        known = np.zeros((nv, 2))
        for row, pole in zip((0, nv - 1), samples.poles, strict=True):
            if pole is not None:
                fixed[row], known[row] = True, pole[:2]
        solve_v = smoothing_operator(basis_v[:, ~fixed], _roughness(smoothing, length / (nv - DEGREE)), False)
        return cls(knots_u, knots_v, basis_u, basis_v, solve_u, solve_v, fixed, known, heights)

    def solve(self, targets: FloatArray) -> FloatArray:
        """Control net (nu, nv, 2) nearest to targets (A, M, 2), its poles where they are."""
        base = (self.basis_v[:, self.fixed] @ self.known[self.fixed])[:, None]
        net = np.empty((self.basis_u.shape[1], len(self.fixed), 2))
        net[:, self.fixed] = self.known[self.fixed]
        net[:, ~self.fixed] = _in_both(self.solve_v, self.solve_u, targets - base)
        return net

    def points(self, net: FloatArray) -> FloatArray:
        """Points (A, M, 2) of a control net at the samples' parameters."""
        return _in_both(self.basis_u, self.basis_v, net)


def fit_samples(samples: Samples, size: tuple[int, int], smoothing_pixels: float, corrections: int) -> Fit:
    """Fit a control net to the samples.

    Each round of corrections solves least squares, moves every sample along its section to where its fitted
    point is nearest, and aims further outwards where a section lost area.

    Parameters
    ----------
    samples : Samples
        Of one tube.
    size : (int, int)
        Control points around and along.
    smoothing_pixels : float
        Waves of 2 pi times this length are halved, shorter ones damped more.
    corrections : int
        Rounds of corrections.
    """
    system = _System.of(samples, size, smoothing_pixels)
    outlines, position = samples.outlines, samples.position
    normals = outward_normals(outlines)
    outwards = np.zeros(len(outlines))
    hidden = samples.weights[..., None] < 1
    net = system.solve(at_fractions(outlines, position))
    for _ in range(corrections):
        fitted = system.points(net)
        position = _feet(outlines, position, fitted)
        outwards = outwards + _missing(samples, fitted, size[1])
        targets = at_fractions(outlines, position) + outwards[:, None, None] * at_fractions(normals, position)
        # What is hidden may go where the rest wants it.
        net = system.solve(np.where(hidden, fitted, targets))
    fitted = system.points(net)
    error = _error(samples, normals, position, fitted, system.basis_v @ system.heights)
    return Fit(net, system.heights, system.knots_u, system.knots_v, error)


def _in_both(first: FloatArray, second: FloatArray, values: FloatArray) -> FloatArray:
    """Apply one operator (p, a) along the first axis of ``values`` (a, b, c), another (q, b) along the next.

    The result (q, p, c) has the axes swapped.
    """
    return np.tensordot(second, np.tensordot(first, values, 1), (1, 1))


def _roughness(smoothing: float, knot: float) -> float:
    """Weight of the penalty on the second differences of control points ``knot`` mm apart.

    Least squares with it let waves of length w pass by 1 / (1 + (2 pi ``smoothing`` / w)^4).
    """
    return max(LEAST_ROUGHNESS, (smoothing / knot) ** 4)


def _row_heights(samples: Samples, knots_v: FloatArray) -> FloatArray:
    """Heights of the control rows, never falling.

    A row of control points has one height, so every iso-curve around the tube is plane. Next to a
    pole two rows share the height: the tangent plane there is level and the end is round.
    """
    count = len(knots_v) - DEGREE - 1
    low, high = samples.poles
    z = np.concatenate(
        [[] if low is None else low[2:], samples.z, [] if high is None else high[2:]], dtype=float
    )
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
        heights[~fixed] = smoothing_operator(bv[:, ~fixed], LEAST_ROUGHNESS, False) @ (z - bv @ known)
    return np.clip(np.maximum.accumulate(heights), z[0], z[-1])


def _parameter_corrections(samples: Samples, heights: FloatArray, knots_v: FloatArray) -> FloatArray:
    """How much further in v (A,) each section's height is reached; at most half a knot interval."""
    length = float(knots_v[-1])
    fine = np.linspace(0, length, 16 * len(heights))
    climbed = basis(fine, knots_v, DEGREE, False) @ heights
    reached = np.interp(samples.z, climbed + 1e-9 * fine, fine)
    limit = length / (2 * (len(heights) - DEGREE))
    return np.clip(reached - samples.section_v, -limit, limit)


def _feet(outlines: FloatArray, position: FloatArray, fitted: FloatArray) -> FloatArray:
    """Fractions (A, M) of the samples moved along their sections towards the feet of their fitted points.

    One tangential Newton step, smoothed around the ring and kept short enough to preserve the order.
    """
    count = outlines.shape[1]
    ahead, behind = at_fractions(outlines, position + 1 / count), at_fractions(outlines, position - 1 / count)
    tangent = (ahead - behind) * (count / 2)
    lag = np.sum((fitted - at_fractions(outlines, position)) * tangent, axis=2)
    move = lag / np.maximum(np.sum(tangent**2, axis=2), 1e-12)
    move = uniform_filter1d(np.clip(move, -0.1, 0.1), max(3, count // 32), axis=1, mode="wrap")
    gap = np.roll(position, -1, axis=1) - position
    gap[:, -1] += 1.0
    shrink = np.roll(move, -1, axis=1) - move
    worst = np.max(-shrink / np.maximum(gap, 1e-9), axis=1, keepdims=True)
    return position + move * np.minimum(1.0, 0.5 / np.maximum(worst, 1e-9))


def _missing(samples: Samples, fitted: FloatArray, rows: int) -> FloatArray:
    """How far (A,) each section must move outwards in mm to regain the volume around it.

    Volume is balanced over the reach of a control row, so that where the surface bridges a jump of the
    outline no lip runs around it; and by a sample's spacing at most.
    """
    window = max(1, round(2 * len(samples.z) / rows))
    thickness = np.gradient(samples.z) if len(samples.z) > 1 else np.ones(1)

    def spread(value: FloatArray) -> FloatArray:
        return gaussian_filter1d(value * thickness, window, mode="nearest")

    around = lengths(fitted)
    step = spread(samples.area - _areas(fitted)) / np.maximum(spread(around), 1e-9)
    limit = around / samples.around
    return np.clip(step, -limit, limit)


def _areas(outlines: FloatArray) -> FloatArray:
    """Areas (A,) of closed polygons (A, M, 2), positive counter-clockwise."""
    following = np.roll(outlines, -1, axis=1)
    return 0.5 * np.sum(outlines[..., 0] * following[..., 1] - outlines[..., 1] * following[..., 0], axis=1)


def _error(
    samples: Samples,
    normals: FloatArray,
    position: FloatArray,
    fitted: FloatArray,
    heights: FloatArray,
) -> float:
    """Mean distance in mm between sections and surface along the surface's normal, by area."""
    apart = fitted - at_fractions(samples.outlines, position)
    away = np.sum(apart * at_fractions(normals, position), axis=2)
    lifted = (heights - samples.z)[:, None]
    distance = np.abs(away * samples.normal[..., 0] + lifted * samples.normal[..., 1])
    return float(np.average(distance, weights=samples.weights * samples.strips))
