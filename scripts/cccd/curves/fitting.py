"""From ordered curves to closed splines: by a tolerance, by a budget, or by the paper's corners.

The reference is the pixel-centre polygon of a curve. A digitised smooth outline lies within half a pixel
of it, in steps; these steps are noise. The automatic fit therefore measures its tolerance against the
polygon with the steps filtered out (over 1.5 pixels, and less for a tolerance so small that it asks for
the pixels), and looks for the fewest knots that stay within it. What is small for its pixels
keeps its shape: on coarse pixels and on short curves the tolerance is smaller. With a budget the splines
are fitted to the polygon itself, every point counting alike.
"""

from __future__ import annotations

import numpy as np
import shapely

from cccd.containers import Curves, Splines
from cccd.curves.corners import sharp_corners
from cccd.curves.knots import FEWEST, fit_closed_spline
from cccd.geometry.arrays import concatenate_ragged, offsets_of, ranks_of, split_ragged, sum_per_part
from cccd.geometry.closed_splines import DEGREE, evaluate, sample_ragged
from cccd.geometry.polygons import RaggedPolygons
from cccd.settings.curves import CurveSettings, SplineFittingSettings, ToleranceSettings
from cccd.tolerances import CHECKED_CLOSER, CHECKED_PER_PIXEL, CHECKED_PER_SPAN, CHECKED_TURN

__all__ = ["corner_splines", "fit_splines", "sample_splines", "uniform_knots"]

#: What holds when nobody says otherwise.
_DEFAULTS = CurveSettings()


def fit_splines(curves: Curves, settings: CurveSettings = _DEFAULTS) -> Splines:
    """Fit a closed cubic spline to every curve.

    Parameters
    ----------
    curves : Curves
        Ordered closed curves; pixel chains or any polygons.
    settings : CurveSettings
        ``tolerance_px`` is the largest distance between the curve and the reference (see the module), less
        on coarse pixels and short curves: the fewest control points that keep it are sought. With
        ``max_control_points`` each curve is the best for that many, and never has more than half as many as
        points (at least 4).

    Returns
    -------
    Splines
        One per curve, none of which crosses itself, or another curve that its own does not touch. A fit
        that does is repeated more stiffly, then with more control points, to which a budget yields.
    """
    sizes = np.diff(curves.offsets)
    sharp = sharp_corners(curves.points, curves.offsets, settings.fitting.sharp)
    target = _budget(sizes, settings.max_control_points)
    apart = _pairs_apart(curves)
    wrong = np.ones(len(curves), bool)
    splines = None
    for sliding, share, multiple in settings.fitting.attempts:
        wanted = np.floor(multiple * target[wrong]).astype(np.int64)
        own = sharp[np.repeat(wrong, sizes)]
        tolerance = share * settings.tolerance_px
        fresh = _fit(_subset(curves, wrong), own, tolerance, wanted, sliding, settings.fitting)
        splines = _replace(splines, wrong, fresh)
        wrong = _crossing(splines, apart)
        if not wrong.any():
            return splines
    return _replace(splines, wrong, _polygon_splines(_subset(curves, wrong)))


def _shares(curves: Curves, rule: ToleranceSettings) -> np.ndarray:
    """Shares (C,) of the tolerance and of the filter's width: less on coarse pixels and on short curves."""
    pixel = float(np.sqrt(curves.frame.pixel_spacing.prod()))
    return min(1.0, rule.coarsest_mm / pixel) * np.minimum(1, curves.polygons.lengths / rule.full_length_px)


def _budget(sizes: np.ndarray, most: float | None) -> np.ndarray:
    """Control points (C,) wanted of curves of so many points; 0 where the tolerance decides."""
    if most is None:
        return np.zeros(len(sizes), np.int64)
    wanted = np.floor(most * sizes) if most < 1 else np.full(len(sizes), most)
    return np.clip(wanted, FEWEST, np.maximum(sizes // 2, FEWEST)).astype(np.int64)


def _fit(
    curves: Curves,
    sharp: np.ndarray,
    tolerance_px: float,
    target: np.ndarray,
    sliding: float,
    settings: SplineFittingSettings,
) -> Splines:
    steps = settings.reference
    shares = _shares(curves, settings.tolerance)
    widest = steps.staircase_px * min(1.0, tolerance_px / steps.pixels_tolerance_px) ** 2
    fits = []
    sharp_parts = split_ragged(sharp, curves.offsets)
    for polygon, corners, tolerance, width, count in zip(
        curves, sharp_parts, shares * tolerance_px, shares * widest, target, strict=True
    ):
        if 0 < count < 2 * DEGREE * np.count_nonzero(corners):  # corners would take most of the budget
            corners = np.zeros_like(corners)
        fits.append(
            fit_closed_spline(polygon, corners, tolerance, 0.0 if count else width, count, sliding, settings)
        )
    control, offsets = concatenate_ragged([fit[0] for fit in fits])
    return _splines(control, offsets, np.concatenate([np.zeros(0), *(fit[1] for fit in fits)]), curves)


def _splines(control: np.ndarray, offsets: np.ndarray, knots: np.ndarray, curves: Curves) -> Splines:
    """Bundle ragged control points and knots (n + 7 per curve) with the slices of their curves."""
    knot_offsets = offsets + (2 * DEGREE + 1) * np.arange(len(offsets))
    return Splines(
        control, offsets, knots, knot_offsets, curves.slice, curves.hole, degree=DEGREE, frame=curves.frame
    )


# The paper's splines ----------------------------------------------------------------------------------


def corner_splines(curves: Curves, corners: np.ndarray) -> Splines:
    """Uniform cubic B-splines whose control points are the corners (Definition 4, equations 6-9).

    Parameters
    ----------
    curves : Curves
    corners : (P,) bool array
        Which points of the curves are corners.

    Returns
    -------
    Splines
        A closed cubic needs four control points; curves with fewer corners get evenly spaced points of
        their own in place of them.

    Notes
    -----
    Printed slips: eq. (7) means ``t_i <= t < t_{i+1}``; k in equations 6-8 is the order (4), one more
    than the degree the text calls it. Eq. (9) is the uniform cubic basis as it should be.
    """
    count = sum_per_part(corners, curves.offsets).astype(np.int64)
    few = count < FEWEST
    even = curves.polygons.resample(np.where(few, FEWEST, 0)).points
    offsets = offsets_of(np.where(few, FEWEST, count))
    control = np.empty((offsets[-1], 2))
    from_even = np.repeat(few, np.diff(offsets))
    control[from_even] = even
    control[~from_even] = curves.points[corners & ~np.repeat(few, np.diff(curves.offsets))]
    return _splines(control, offsets, uniform_knots(np.diff(offsets)), curves)


def uniform_knots(counts: np.ndarray) -> np.ndarray:
    """Knots -3, -2, .. n + 3 of closed uniform cubics with n = ``counts[c]`` control points each."""
    return ranks_of(np.asarray(counts) + 2 * DEGREE + 1).astype(float) - DEGREE


def _polygon_splines(curves: Curves) -> Splines:
    """Uniform cubics through control points so dense on the polygon that they cross only where it does."""
    counts = np.ceil(4 * curves.polygons.lengths).astype(np.int64)
    control = curves.polygons.resample(np.maximum(counts, FEWEST))
    return _splines(control.points, control.offsets, uniform_knots(control.sizes), curves)


# Sampling and checking --------------------------------------------------------------------------------


def sample_splines(splines: Splines, per_pixel: float = 2.0) -> Curves:
    """Draw the splines as closed polygons with about ``per_pixel`` points per pixel of control polygon."""
    length = RaggedPolygons(splines.control_points, splines.offsets).lengths
    counts = np.maximum(np.ceil(per_pixel * length), 4 * np.diff(splines.offsets)).astype(np.int64)
    points = sample_ragged(splines.control_points, splines.offsets, splines.knots, counts)
    return Curves(points, offsets_of(counts), splines.slice, splines.hole, splines.frame)


def _pairs_apart(curves: Curves) -> np.ndarray:
    """Pairs (N, 2) of curves of one slice that do not touch, though their boxes come within two pixels."""
    size = np.unique(curves.slice, return_counts=True)[1]
    first = offsets_of(size)[:-1]
    several = [
        begin + np.column_stack(np.triu_indices(n, 1)) for begin, n in zip(first, size, strict=True) if n > 1
    ]
    if not several:
        return np.zeros((0, 2), np.int64)
    pairs = np.concatenate(several)
    low = np.minimum.reduceat(curves.points, curves.offsets[:-1]) - 1
    high = np.maximum.reduceat(curves.points, curves.offsets[:-1]) + 1
    a, b = pairs.T
    pairs = pairs[((low[a] <= high[b]) & (low[b] <= high[a])).all(axis=1)]
    rings = curves.polygons.rings()
    return pairs[~shapely.intersects(rings[pairs[:, 0]], rings[pairs[:, 1]])]


def _crossing(splines: Splines, apart: np.ndarray) -> np.ndarray:
    """Splines (C,) bool that cross themselves, or another one whose curve does not touch theirs."""
    lines = RaggedPolygons.of([_line(control, knots) for control, knots in splines])
    wrong = ~lines.is_simple
    if len(apart):
        rings = lines.rings()
        wrong[apart[shapely.intersects(rings[apart[:, 0]], rings[apart[:, 1]])].ravel()] = True
    return wrong


def _line(control: np.ndarray, knots: np.ndarray) -> np.ndarray:
    """Points (N, 2) along a spline, ever closer where it turns: no fold is small between two of them."""
    u = _looks(knots)
    points = evaluate(knots, control, u)
    for _ in range(CHECKED_CLOSER):
        step = np.roll(points, -1, axis=0) - points
        before = np.roll(step, 1, axis=0)
        across = before[:, 0] * step[:, 1] - before[:, 1] * step[:, 0]
        bent = np.abs(np.arctan2(across, (before * step).sum(axis=1))) > CHECKED_TURN
        begin = np.flatnonzero(bent | np.roll(bent, -1))
        if not len(begin):
            break
        gap = np.diff(u, append=knots[-DEGREE - 1] - knots[DEGREE] + u[0])
        u = np.sort(np.concatenate([u, *(u[begin] + share * gap[begin] for share in (0.25, 0.5, 0.75))]))
        points = evaluate(knots, control, u)
    return points


def _looks(knots: np.ndarray) -> np.ndarray:
    """Ascending parameters at which a spline shows its folds, small as they may be.

    Folds sit where knots crowd, so that every span is looked at, and beside sharp corners, where the
    looks close in on the repeated knot.
    """
    begin, length = knots[DEGREE : -DEGREE - 1], np.diff(knots[DEGREE:-DEGREE])
    looks = np.where(length > 0, np.maximum(np.ceil(CHECKED_PER_PIXEL * length), CHECKED_PER_SPAN), 0)
    looks = looks.astype(int)
    u = np.repeat(begin, looks) + ranks_of(looks) * np.repeat(length / np.maximum(looks, 1), looks)
    sharp = np.unique(begin[length == 0])
    if len(sharp):
        period = knots[-DEGREE - 1] - knots[DEGREE]
        near = 0.5 ** np.arange(12)
        beside = sharp[:, None] + np.concatenate([near, -near])
        u = np.unique(np.concatenate([u, (beside.ravel() - begin[0]) % period + begin[0]]))
    return u


def _subset(curves: Curves, chosen: np.ndarray) -> Curves:
    if chosen.all():
        return curves
    part = curves.polygons.take(chosen)
    return Curves(part.points, part.offsets, curves.slice[chosen], curves.hole[chosen], curves.frame)


def _replace(splines: Splines | None, chosen: np.ndarray, others: Splines) -> Splines:
    """Put the others in the place of the chosen splines; while there are none, the others are all."""
    if splines is None:
        return others
    fresh = iter(others)
    pairs = [next(fresh) if wanted else own for own, wanted in zip(splines, chosen, strict=True)]
    control, offsets = concatenate_ragged([pair[0] for pair in pairs])
    knots = np.concatenate([pair[1] for pair in pairs])
    knot_offsets = offsets + (2 * DEGREE + 1) * np.arange(len(offsets))
    return Splines(
        control, offsets, knots, knot_offsets, splines.slice, splines.hole, splines.degree, splines.frame
    )
