"""From ordered curves to closed splines: by a tolerance, by a budget, or by the paper's corners.

The reference is the pixel-centre polygon of a curve. A digitised smooth outline lies within half a pixel
of it, in steps; these steps are noise. The automatic fit therefore measures its tolerance against the
polygon with the steps filtered out (over 1.5 pixels, and less for a tolerance so small that it asks for
the pixels), and looks for the fewest knots that stay within it. What is small for its pixels
keeps its shape: on coarse pixels and on short curves the tolerance is smaller. With a budget the splines
are fitted to the polygon itself, every point counting alike.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple, cast

import numpy as np
import shapely

from cccd.containers import Curves, Splines
from cccd.curves.corners import sharp_corners
from cccd.curves.knots import FEWEST, FEWEST_SAMPLES, SPACING_PX, STAIRCASE_PX, fit_closed_spline, reference
from cccd.geometry.arrays import (
    FloatArray,
    concatenate_ragged,
    offsets_of,
    ranks_of,
    split_ragged,
    sum_per_part,
)
from cccd.geometry.polygons import DEGREE, RaggedPolygons, evaluate_spline, extend_knots
from cccd.settings.curves import CurveSettings

#: Makes splines of curves, and says how far (C,) in pixels each may lie from its curve.
_Way = Callable[[Curves], tuple[Splines, np.ndarray]]

# Tangential weight, share of the tolerance and multiple of the budget of each fit while splines cross:
# nearest first; stiffer fits fold less easily, and more knots follow more closely.
_ATTEMPTS = (
    (0.03, 1.0, 1.0),
    (0.3, 1.0, 1.0),
    (1.0, 1.0, 1.0),
    (1.0, 0.7, 1.25),
    (1.0, 0.5, 1.5),
    (1.0, 0.25, 2.0),
    (1.0, 0.1, 4.0),
)

# The tolerance does not grow with pixels larger than this: organs are as curved on coarse pixels. Shorter
# curves have one in proportion to their length, or a bronchus of six pixels would lose a tenth of its width.
_COARSEST_MM = 1.5
_FULL_LENGTH_PX = 120.0

# Below this tolerance the filter narrows with its square: a small tolerance brings the pixels back.
_PIXELS_TOLERANCE_PX = 0.15
#: Samples per pixel, and per span at least, at which a spline is checked for crossings ...
_CHECKED_PER_PIXEL = 3.0
_CHECKED_PER_SPAN = 12
#: ... and where these turn by more than this (radians), the gaps beside are quartered, so many times.
_CHECKED_TURN = 0.5
_CHECKED_CLOSER = 3
#: Whether it strays is asked of every third sample: excursions are as long as the spans, crossings are not.
_CHECKED_EVERY = 3
#: A spline lies at most this much further from its curve than its fit's tolerance: the filter that takes the
#: steps away moves a curve by up to half a pixel.
_STRAY_PX = 0.75

#: What holds when nobody says otherwise.
_DEFAULTS = CurveSettings()


class CheckedSplines(NamedTuple):
    """Closed splines of curves, and what their check found."""

    splines: Splines
    mended: np.ndarray  # (C,) bool: the first spline was wrong, this one is not
    wrong: np.ndarray  # (C,) bool: nothing could be done, because the curve itself crosses


def fit_splines(curves: Curves, settings: CurveSettings = _DEFAULTS) -> Splines:
    """Fit a closed cubic spline to every curve: the splines of `fit_checked`."""
    return fit_checked(curves, settings).splines


def fit_checked(
    curves: Curves, settings: CurveSettings = _DEFAULTS, first: Splines | None = None
) -> CheckedSplines:
    """Fit a closed cubic spline to every curve; check all of them, and mend those that are wrong.

    Parameters
    ----------
    curves : Curves
        Ordered closed curves; pixel chains or any polygons.
    settings : CurveSettings
        ``tolerance_px`` is the largest distance between the curve and the reference (see the module), less
        on coarse pixels and short curves: the fewest control points that keep it are sought. With
        ``max_control_points`` each curve is the best for that many, and never has more than half as many as
        points (at least 4).
    first : Splines, optional
        What is checked in place of a first fit, such as the paper's splines; they may lie away from their
        curves.

    Returns
    -------
    CheckedSplines
        One spline per curve. It does not cross itself, nor another whose curve its own does not touch; it
        turns as its curve does and lies near it all along. One that is wrong is fitted again, more stiffly,
        then with more control points, to which a budget yields. What is still wrong gets its curve, smoothed,
        for a control polygon, and at last the curve itself.
    """
    ways: list[_Way] = [partial(_fitted, settings, *attempt) for attempt in _ATTEMPTS]
    ways += [partial(_along_reference, settings), _along_curve]
    if first is not None:
        given = first, np.full(len(curves), np.inf)
        ways.insert(0, lambda _: given)
    wrong = np.ones(len(curves), bool)
    check, splines, mended = _Check(curves), None, wrong
    for number, way in enumerate(ways):
        fresh, reach = way(_subset(curves, wrong))
        splines = _replace(splines, wrong, fresh)
        wrong = check.wrong(fresh, wrong, reach)
        mended = mended if number else wrong
        if not wrong.any():
            break
    assert splines is not None  # there is a way at least
    return CheckedSplines(splines, mended & ~wrong, wrong)


def _shares(curves: Curves) -> np.ndarray:
    """Shares (C,) of the tolerance and of the filter's width: less on coarse pixels and on short curves."""
    pixel = float(np.sqrt(curves.frame.pixel_spacing.prod()))
    return min(1.0, _COARSEST_MM / pixel) * np.minimum(1, curves.polygons.lengths / _FULL_LENGTH_PX)


def _budget(sizes: np.ndarray, most: float | None) -> np.ndarray:
    """Control points (C,) wanted of curves of so many points; 0 where the tolerance decides."""
    if most is None:
        return np.zeros(len(sizes), np.int64)
    wanted = np.floor(most * sizes) if most < 1 else np.full(len(sizes), most)
    return np.clip(wanted, FEWEST, np.maximum(sizes // 2, FEWEST)).astype(np.int64)


def _filter_px(tolerance_px: float) -> float:
    """Width of the filter for a tolerance, before what is small for its pixels gets its share."""
    return STAIRCASE_PX * min(1.0, tolerance_px / _PIXELS_TOLERANCE_PX) ** 2


def _fitted(
    settings: CurveSettings, sliding: float, share: float, multiple: float, curves: Curves
) -> tuple[Splines, np.ndarray]:
    """Fit splines, and say how far (C,) each may lie from its curve; nowhere where the fit failed."""
    tolerance_px = share * settings.tolerance_px
    target = np.floor(multiple * _budget(np.diff(curves.offsets), settings.max_control_points))
    sharp = split_ragged(sharp_corners(curves.points, curves.offsets), curves.offsets)
    shares = _shares(curves)
    widest = _filter_px(tolerance_px)
    fits: list[tuple[FloatArray, FloatArray, float]] = []
    for polygon, corners, tolerance, width, count in zip(
        curves, sharp, shares * tolerance_px, shares * widest, target.astype(np.int64), strict=True
    ):
        if 0 < count < 2 * DEGREE * np.count_nonzero(corners):  # corners would take most of the budget
            corners = np.zeros_like(corners)
        fits.append(fit_closed_spline(polygon, corners, tolerance, 0.0 if count else width, count, sliding))
    control, offsets = concatenate_ragged([fit[0] for fit in fits])
    splines = _splines(control, offsets, np.concatenate([np.zeros(0), *(fit[1] for fit in fits)]), curves)
    missed = np.array([fit[2] for fit in fits])
    if settings.max_control_points is None:
        most = _STRAY_PX + shares * settings.tolerance_px
        return splines, np.where(missed <= most, most, -np.inf)  # nan too
    return splines, np.where(np.isfinite(missed), _STRAY_PX + _left_out(splines, curves), -np.inf)


def _left_out(splines: Splines, curves: Curves) -> np.ndarray:
    """How far (C,) in pixels the furthest point of each curve lies from its spline."""
    rings = splines.sample().polygons.rings()
    shapely.prepare(rings)
    far = cast(Any, shapely).distance(shapely.points(curves.points), rings[curves.polygons.owners])
    return np.maximum.reduceat(far, curves.offsets[:-1]) if len(curves) else np.zeros(0)


def _splines(control: np.ndarray, offsets: np.ndarray, knots: np.ndarray, of: Curves | Splines) -> Splines:
    """Bundle ragged control points and knots (n + 7 per curve) with the slices of what they are of."""
    knot_offsets = offsets + (2 * DEGREE + 1) * np.arange(len(offsets))
    return Splines(control, offsets, knots, knot_offsets, of.slice, of.hole, DEGREE, of.frame)


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
    return _splines(control, offsets, _uniform_knots(np.diff(offsets)), curves)


def _uniform_knots(counts: np.ndarray) -> np.ndarray:
    """Knots -3, -2, .. n + 3 of closed uniform cubics with n = ``counts[c]`` control points each."""
    return ranks_of(np.asarray(counts) + 2 * DEGREE + 1).astype(float) - DEGREE


def _along_reference(settings: CurveSettings, curves: Curves) -> tuple[Splines, np.ndarray]:
    """Take the curves without their steps for control polygons: the splines stay in these' convex hulls."""
    widths = _shares(curves) * _filter_px(settings.tolerance_px)
    smooth = [
        reference(polygon, np.zeros(len(polygon), bool), SPACING_PX, width, FEWEST_SAMPLES)[0]
        for polygon, width in zip(curves, widths, strict=True)
    ]
    control, offsets = concatenate_ragged(smooth)
    return _splines(control, offsets, _uniform_knots(np.diff(offsets)), curves), np.full(len(curves), np.inf)


def _along_curve(curves: Curves) -> tuple[Splines, np.ndarray]:
    """Turn the curves themselves into splines, a triple knot in every point: these cross only with them."""
    polygons = curves.polygons
    edge = polygons.steps[polygons.predecessors][:, None]
    thirds = polygons.points[:, None] - np.arange(DEGREE - 1, -1, -1)[:, None] / DEGREE * edge
    offsets = DEGREE * polygons.offsets
    breaks = [np.repeat(np.arange(float(size)), DEGREE) for size in polygons.sizes]
    knots = np.concatenate([np.zeros(0), *(extend_knots(own, len(own) // DEGREE) for own in breaks)])
    return _splines(thirds.reshape(-1, 2), offsets, knots, curves), np.full(len(curves), np.inf)


def _pairs_near(curves: Curves) -> np.ndarray:
    """Pairs (N, 2) of curves of one slice whose boxes come within two pixels."""
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
    return pairs[((low[a] <= high[b]) & (low[b] <= high[a])).all(axis=1)]


def _pairs_apart(curves: Curves) -> np.ndarray:
    """Pairs (N, 2) of curves of one slice that do not touch, though their boxes come within two pixels."""
    pairs, rings = _pairs_near(curves), curves.polygons.rings()
    return pairs[~shapely.intersects(rings[pairs[:, 0]], rings[pairs[:, 1]])]


def crossed_curves(curves: Curves) -> tuple[np.ndarray, np.ndarray]:
    """Where two curves of one slice cross: the slices (N,), and a point (N, 2) in pixels for each pair.

    Curves that touch do not cross; those that cross themselves are left out.
    """
    pairs, rings = _pairs_near(curves), curves.polygons.rings()
    pairs = pairs[curves.polygons.is_simple[pairs].all(axis=1)]
    areas = np.asarray(shapely.polygons(rings))
    pairs = pairs[shapely.overlaps(areas[pairs[:, 0]], areas[pairs[:, 1]])]
    meet = shapely.intersection(rings[pairs[:, 0]], rings[pairs[:, 1]])
    at = [shapely.get_coordinates(place)[0] for place in meet]
    return curves.slice[pairs[:, 0]], np.reshape(at, (-1, 2))


class _Check:
    """What is wrong with the splines of curves; those that were right once are not looked at again."""

    def __init__(self, curves: Curves):
        self._curves = curves
        self._apart = _pairs_apart(curves)
        #: Splines as they are (0), and as they are drawn to be lofted (1).
        self._rings = np.empty((2, len(curves)), object)

    def wrong(self, fresh: Splines, chosen: np.ndarray, reach: np.ndarray) -> np.ndarray:
        """Find the splines (C,) bool that cross, turn the wrong way or stray.

        Parameters
        ----------
        fresh : Splines
            New splines of the chosen curves (C,) bool; the others are right but for crossing one of these.
        reach : (chosen curves,) float
            How far in pixels they may lie from their curves.
        """
        own = self._curves.polygons.take(chosen)
        lines = RaggedPolygons.of([_line(control, knots) for control, knots in fresh])
        bad = ~(lines.signed_areas * own.signed_areas > 0) | ~(reach > 0)
        for row, drawn in enumerate((lines, fresh.sample().polygons)):
            bad |= ~drawn.is_simple
            self._rings[row, chosen] = drawn.rings()
        bad |= _strays(lines, own, reach)
        wrong = np.zeros(len(chosen), bool)
        wrong[chosen] = bad
        pairs = self._apart[chosen[self._apart].any(axis=1)]
        for rings in self._rings:
            wrong[pairs[shapely.intersects(rings[pairs[:, 0]], rings[pairs[:, 1]])].ravel()] = True
        return wrong


def _strays(lines: RaggedPolygons, polygons: RaggedPolygons, reach: np.ndarray) -> np.ndarray:
    """Lines (C,) bool that have a point further than ``reach`` (C,) from their polygons."""
    owner = lines.owners[::_CHECKED_EVERY]
    looked = np.isfinite(reach)[owner]
    owner, points = owner[looked], shapely.points(lines.points[::_CHECKED_EVERY][looked])
    rings = polygons.rings()
    shapely.prepare(rings)
    strays = np.zeros(len(lines), bool)
    near = shapely.dwithin(rings[owner], points, cast(Any, reach[owner]))  # shapely's types know one distance
    strays[owner[~near]] = True
    return strays


def crossing_place(control: np.ndarray, knots: np.ndarray) -> np.ndarray:
    """Where a spline crosses itself (2,), to a fraction of a pixel; its first point where it does not."""
    line = _line(control, knots)
    noded: FloatArray = cast(Any, shapely).get_coordinates(shapely.node(shapely.LinearRing(line)))
    met: set[tuple[float, ...]] = {*map(tuple, noded.tolist())} - {*map(tuple, line.tolist())}
    return np.array(min(met)) if met else line[0]


def _line(control: np.ndarray, knots: np.ndarray) -> np.ndarray:
    """Points (N, 2) along a spline, ever closer where it turns: no fold is small between two of them."""
    u = _looks(knots)
    points = evaluate_spline(knots, control, u)
    for _ in range(_CHECKED_CLOSER):
        step = np.roll(points, -1, axis=0) - points
        before = np.roll(step, 1, axis=0)
        across = before[:, 0] * step[:, 1] - before[:, 1] * step[:, 0]
        bent = np.abs(np.arctan2(across, (before * step).sum(axis=1))) > _CHECKED_TURN
        begin = np.flatnonzero(bent | np.roll(bent, -1))
        if not len(begin):
            break
        gap = np.diff(u, append=knots[-DEGREE - 1] - knots[DEGREE] + u[0])
        u = np.sort(np.concatenate([u, *(u[begin] + share * gap[begin] for share in (0.25, 0.5, 0.75))]))
        points = evaluate_spline(knots, control, u)
    return points


def _looks(knots: np.ndarray) -> np.ndarray:
    """Ascending parameters at which a spline shows its folds, small as they may be."""
    # Folds sit where knots crowd, so that every span is looked at, and beside sharp corners, where the looks
    # close in on the repeated knot.
    begin, length = knots[DEGREE : -DEGREE - 1], np.diff(knots[DEGREE:-DEGREE])
    looks = np.where(length > 0, np.maximum(np.ceil(_CHECKED_PER_PIXEL * length), _CHECKED_PER_SPAN), 0)
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
    return _splines(control, offsets, knots, splines)
