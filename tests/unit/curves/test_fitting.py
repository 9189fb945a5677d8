import itertools
from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from scipy import ndimage
from scipy.interpolate import BSpline
from support.known_curves import random_spline

from cccd.containers import Frame
from cccd.contours import trace_stack
from cccd.curves import periodic
from cccd.curves.corners import k_cosine_corners
from cccd.curves.describe import describe_curves
from cccd.curves.fitting import _along_curve, _along_reference, corner_splines, fit_checked, fit_splines
from cccd.curves.knots import reference
from cccd.geometry.polygons import RaggedPolygons, evaluate_spline, extend_knots
from cccd.settings.curves import CurveSettings
from cccd_workflow.curve_measures import area_scores, distances


def at_most(budget):
    return CurveSettings(max_control_points=budget)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("tolerance", [0.3, 0.5, 1.0])
def test_tolerance_is_kept_with_few_points(blob, seed, tolerance):
    curves = blob(seed)[1]
    splines = fit_splines(curves, CurveSettings(tolerance_px=tolerance))
    drawn = splines.sample(4)
    for polygon, line in zip(curves, drawn, strict=True):
        smooth, _ = reference(polygon, np.zeros(len(polygon), bool), 0.25, 1.5, 24)
        away = shapely.distance(shapely.points(smooth), shapely.linearrings(line))
        assert away.max() <= tolerance + 0.04  # at the samples it is kept, between them almost
    assert distances(curves.points, curves.offsets, drawn).max() <= tolerance + 0.6  # and the steps
    if tolerance >= 0.5:
        assert len(splines.control_points) < 0.1 * len(curves.points)
    kept = drawn.polygons.signed_areas / curves.polygons.signed_areas
    assert kept == pytest.approx(1, abs=2e-3)


def test_smaller_tolerances_follow_the_pixels_more_closely(blob):
    curves = blob(7)[1]
    away, count = [], []
    for tolerance in (2.0, 1.0, 0.5, 0.2, 0.05):
        splines = fit_splines(curves, CurveSettings(tolerance_px=tolerance))
        away.append(distances(curves.points, curves.offsets, splines.sample(8)).mean())
        count.append(len(splines.control_points))
    assert np.all(np.diff(away) < 0)
    assert np.all(np.diff(count) >= 0)
    assert away[-1] < 0.05


@pytest.mark.parametrize("seed", range(3))
def test_a_budget_is_kept_and_pixels_are_followed_as_far_as_they_are_known(blob, seed):
    curves = blob(seed, waves=0.25)[1]
    for share in (0.1, 0.05):
        splines = fit_splines(curves, at_most(share))
        counts = np.diff(splines.offsets)
        assert np.all(counts <= np.maximum(share * np.diff(curves.offsets), 4))
        drawn = splines.sample(4)
        away = distances(curves.points, curves.offsets, drawn)
        for here in np.split(away, curves.offsets[1:-1]):
            assert np.sqrt(np.mean(here**2)) < 1 / np.sqrt(12)  # what rounding to pixels costs
    assert np.diff(fit_splines(curves, at_most(12)).offsets).tolist() == [12] * len(curves)


@pytest.mark.parametrize("seed", [11, 12])
def test_automatic_count_is_near_the_fewest_any_fixed_count_needs(blob, seed):
    curves = blob(seed, slices=1)[1]
    smooth, _ = reference(curves.points, np.zeros(len(curves.points), bool), 0.25, 1.5, 24)

    def worst(splines):
        line = splines.sample(4).points
        return shapely.distance(shapely.points(smooth), shapely.linearrings(line)).max()

    splines = fit_splines(curves, CurveSettings(tolerance_px=0.5))
    count = len(splines.control_points)
    assert worst(splines) <= 0.54
    fewer = [fit_splines(curves, at_most(n)) for n in range(4, int(np.ceil(count / 1.1)))]
    assert all(worst(other) > 0.5 for other in fewer)


def test_a_rectangle_keeps_its_corners_and_a_circle_has_none(frame):
    mask = np.zeros((2, 120, 120), bool)
    mask[0, 20:90, 30:100] = True
    i, j = np.meshgrid(np.arange(120) - 60, np.arange(120) - 60, indexing="ij")
    mask[1] = np.hypot(i, j) < 40.3
    curves = trace_stack(mask, (0, 0, 0), frame)
    splines = fit_splines(curves, CurveSettings(tolerance_px=0.5))
    (square, square_knots), (disc, disc_knots) = splines
    drawn = splines.sample(8)
    for vertex in [(20, 30), (20, 99), (89, 99), (89, 30)]:
        assert np.linalg.norm(square - vertex, axis=1).min() < 0.02  # a control point on the curve
    assert np.count_nonzero(np.diff(square_knots[3:-3]) == 0) == 2 * 4
    assert len(square) <= 16
    assert np.all(np.diff(disc_knots) > 0)
    assert len(disc) <= 10
    radius = np.hypot(*(drawn.points[drawn.offsets[1] :] - 60).T)
    assert radius.mean() == pytest.approx(40, abs=0.3)
    assert np.ptp(radius) < 1
    assert area_scores(curves, drawn)[0][0] > 0.9998


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([None, 0.05, 0.1, 6]))
@example(1_861_228_300, None)  # knots without end
@example(305, None)  # a fold between two looks
@example(3986, None)  # knots that crowd at one place
def test_splines_never_cross_themselves_however_small_or_ragged(seed, budget):
    mask = np.random.default_rng(seed).random((2, 14, 15)) < 0.62
    curves = trace_stack(mask, (0, 0, 0), Frame(np.eye(4), 2, (60, 60, 4)))
    splines = fit_splines(curves, at_most(budget))
    drawn = splines.sample(8)
    assert drawn.polygons.is_simple.all()
    assert np.isfinite(splines.control_points).all()
    assert np.diff(splines.offsets).min(initial=4) >= 4


@pytest.mark.parametrize("budget", [None, 0.1, 0.04])
def test_acute_corners_do_not_fold(frame, budget):
    mask = np.zeros((3, 200, 200), bool)
    i, j = np.meshgrid(np.arange(200), np.arange(200), indexing="ij")
    for layer, slope in enumerate((0.15, 0.3, 0.6)):
        mask[layer] = (np.abs(i - 100 - 12 * np.sin(j / 30)) < slope * (j - 20)) & (j < 180)
    curves = trace_stack(mask, (0, 0, 0), frame)
    drawn = fit_splines(curves, at_most(budget)).sample(20)
    assert drawn.polygons.is_simple.all()


def test_thin_walls_are_not_crossed(frame):
    mask = np.zeros((1, 60, 60), bool)
    mask[0, 10:50, 10:50] = True
    mask[0, 12:48, 12:48] = False  # a wall two pixels wide
    mask[0, 30, 12:46] = True  # and a spit within
    curves = trace_stack(mask, (0, 0, 0), frame)
    for splines in (fit_splines(curves), fit_splines(curves, at_most(0.05))):
        rings = [shapely.Polygon(line) for line in splines.sample(4)]
        rings.sort(key=lambda ring: -ring.area)
        assert all(ring.is_valid for ring in rings)
        assert rings[0].contains_properly(rings[1])


def test_the_same_curves_give_the_same_splines_in_any_company(blob, curves_of):
    polygons = list(blob(3, slices=3)[1])
    together = fit_splines(curves_of(*polygons))
    for polygon, (control, knots) in zip(polygons, together, strict=True):
        alone = fit_splines(curves_of(polygon))
        assert np.array_equal(alone.control_points, control)
        assert np.array_equal(alone.knots, knots)


def test_corner_splines_are_equation_9(blob):
    curves = blob(1)[1]
    corner = k_cosine_corners(curves.points, curves.offsets, 7)
    splines = corner_splines(curves, corner)
    assert np.array_equal(splines.control_points, curves.points[corner])
    control, knots = next(iter(splines))
    curve = BSpline(knots, np.vstack([control, control[:3]]), 3)

    def blend(t):  # eq. (9)
        t = np.abs(t)
        return np.where(t < 1, 4 - 6 * t**2 + 3 * t**3, np.where(t < 2, (2 - t) ** 3, 0)) / 6

    n = len(control)
    for t in (0.0, 0.3, 7.75, n - 0.01):
        # control point i of the wrapped spline has its maximum at parameter i - 1
        distance = (t - (np.arange(n) - 1) + n / 2) % n - n / 2
        assert curve(t) == pytest.approx(blend(distance) @ control, abs=1e-9)


def test_too_few_corners_are_made_up_by_points_of_the_curve(curves_of):
    square = np.array([(0, 0), (0, 4), (4, 4), (4, 0)], float)
    corner = np.array([True, False, False, False] + [True] * 4)
    splines = corner_splines(curves_of(square, 3 * square), corner)
    assert np.diff(splines.offsets).tolist() == [4, 4]
    assert np.array_equal(splines.control_points, np.vstack([square, 3 * square]))


@pytest.mark.parametrize("seed", range(3))
def test_splines_are_nearer_to_the_outline_than_its_pixels_are(seed):
    """Smooth outlines are digitised; the pixels' own error bounds what agreement with them can mean."""
    rng, angle, wave = (
        np.random.default_rng(seed),
        np.linspace(0, 2 * np.pi, 2000, endpoint=False),
        np.arange(2, 9),
    )
    lobes = np.cos(np.outer(wave, angle) + rng.uniform(0, 2 * np.pi, (7, 1)))
    radius = 60 * (1 + (rng.normal(0, 0.25, 7) / wave) @ lobes)
    outline = shapely.Polygon(130 + radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)]))
    mask = shapely.contains_xy(outline, *np.mgrid[:260, :260])
    curves = trace_stack(mask[None], (0, 0, 0), Frame(np.eye(4), 0, (1, 260, 260)))
    insets = [outline.buffer(-inset) for inset in np.linspace(0.2, 0.6, 9)]  # pixel centres lie inside

    def dice_of(a, b):
        return 2 * a.intersection(b).area / (a.area + b.area)

    def to_outline(shape):
        return max(dice_of(inset, shape) for inset in insets)

    pixels = shapely.Polygon(curves.points)
    spline = shapely.Polygon(fit_splines(curves, at_most(0.1)).sample(8).points)
    assert to_outline(spline) > 0.998
    assert dice_of(spline, pixels) > to_outline(pixels)


def ring_of(control, knots):
    """A spline as a fine ring: 25 points a span, which know nothing of the check's own."""
    breaks = np.unique(knots[3:-3])
    u = np.concatenate([np.linspace(a, b, 25, endpoint=False) for a, b in itertools.pairwise(breaks)])
    return shapely.LinearRing(BSpline(knots, np.vstack([control, control[:3]]), 3)(u))


def noisy_tumour(seed, sigma=1.5):
    """Traced slices of a threshold in smooth noise, its border roughened: long, thin, ragged outlines."""
    rng = np.random.default_rng(seed)
    field = ndimage.gaussian_filter(rng.normal(size=(2, 48, 48)), (0, sigma, sigma))
    mask = field / field.std() + 0.3 * rng.normal(size=field.shape) > 0.5
    return trace_stack(mask, (0, 0, 0), Frame(np.eye(4), 0, mask.shape))


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([None, 0.05]))
@example(89, None)  # a needle of 13 pixels that does not cross itself
@example(3, 0.05)  # one of 78
@example(1872, 0.05)  # one that lies further out than its curve from it
def test_no_spline_leaves_its_curve(seed, budget):
    """Where a span holds no sample, least squares leave it free: without a check it swings out far."""
    curves = noisy_tumour(seed)
    checked = fit_checked(curves, at_most(budget))
    assert not checked.wrong.any()
    drawn = checked.splines.sample()
    assert drawn.polygons.is_simple.all()
    assert np.all(drawn.polygons.signed_areas * curves.polygons.signed_areas > 0)
    for polygon, (control, knots) in zip(curves, checked.splines, strict=True):
        line, own = ring_of(control, knots), shapely.LinearRing(polygon)
        assert line.is_simple
        away = shapely.distance(shapely.points(line.coords), own).max()
        back = shapely.distance(shapely.points(own.coords), line).max()
        assert away < (1 if budget is None else 1 + 1.5 * back)


def test_what_is_mended_is_counted_and_the_others_stay(blob):
    curves = noisy_tumour(89)
    checked = fit_checked(curves)
    assert 0 < checked.mended.sum() < len(curves) / 10
    smooth = blob(0)[1]
    assert not fit_checked(smooth).mended.any()


def test_the_papers_splines_are_mended_where_they_cross(curves_of):
    eight = np.array([(0, 0), (40, 40), (40, 0), (0, 40)], float)  # corners in an order that crosses
    square = RaggedPolygons.of([eight[[0, 2, 1, 3]]]).resample(np.array([160])).points
    curves = curves_of(square, square + 100)
    good = corner_splines(curves, np.arange(320) % 20 == 0)
    control = good.control_points.copy()
    control[:8] = np.repeat(eight, 2, axis=0) + np.tile([(0.0, 0.0), (3.0, 1.0)], (4, 1))
    checked = fit_checked(curves, first=replace(good, control_points=control))
    assert checked.mended.tolist() == [True, False]
    fitted = list(checked.splines)
    assert np.array_equal(fitted[1][0], good.control_points[8:])
    assert shapely.LinearRing(ring_of(*fitted[0])).is_simple


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_the_last_resorts_are_simple_without_a_fit(seed):
    mask = np.random.default_rng(seed).random((1, 14, 15)) < 0.6
    curves = trace_stack(mask, (0, 0, 0), Frame(np.eye(4), 0, (1, 60, 60)))
    for polygon, (control, knots) in zip(curves, _along_curve(curves)[0], strict=True):
        line = ring_of(control, knots)
        assert line.is_simple
        assert shapely.hausdorff_distance(line, shapely.LinearRing(polygon)) < 1e-9
    for polygon, (control, knots) in zip(curves, _along_reference(CurveSettings(), curves)[0], strict=True):
        assert shapely.hausdorff_distance(ring_of(control, knots), shapely.LinearRing(polygon)) < 1


def test_walls_thinner_than_any_fit_are_kept_apart(curves_of):
    """Two lines a hundredth of a pixel apart, as the level of probabilities may have."""
    angle = np.linspace(0, 2 * np.pi, 300, endpoint=False)
    wave = 20 + np.sign(np.sin(40 * angle))
    rim = wave[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    curves = curves_of(1.0005 * rim + 50, rim[::-1] + 50, slices=[0, 0])
    checked = fit_checked(curves)
    assert not checked.wrong.any()
    outer, inner = (shapely.Polygon(ring_of(*spline)) for spline in checked.splines)
    assert outer.is_valid
    assert inner.is_valid
    assert outer.contains_properly(inner)


def test_curves_that_cross_each_other_are_said_and_those_that_touch_are_not(curves_of):
    square = np.array([(10, 10), (30, 10), (30, 30), (10, 30)], float)
    curves = curves_of(square, square + 15, square + 20, slices=[3, 3, 4])
    (line,) = describe_curves(curves, CurveSettings()).report["warnings"]
    assert line.startswith("2 curves cross each other, and so do the splines: slice 3 at (")
    assert "; " not in line
    for other in (square + 20, square + 40, (square / 2 + 10)[::-1], (square / 2 + 5)[::-1]):
        touching = curves_of(square, other, slices=[3, 3])
        assert describe_curves(touching, CurveSettings()).report["warnings"] == []


def test_many_crossings_are_one_line(curves_of):
    eight = np.array([(0, 0), (9, 9), (9, 0), (0, 9.5)])
    (line,) = describe_curves(curves_of(*[eight + 20] * 7), CurveSettings()).report["warnings"]
    assert line.startswith("7 curves cross")
    assert line.count("slice") == 5
    assert line.endswith("and so on")


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(4, 40))
def test_least_squares_is_that_of_the_wrapped_design_matrix(seed, count):
    knots, _, rng = random_spline(seed, count)
    u = np.sort(rng.uniform(knots[3], knots[-4], 12 * count))
    points = rng.normal(size=(len(u), 2))
    design = BSpline.design_matrix(u, knots, 3).toarray()
    wrapped = design[:, :count].copy()
    wrapped[:, :3] += design[:, count:]
    assume(np.linalg.cond(wrapped) < 100)  # what the points do not tell the ridge decides
    best = points - wrapped @ np.linalg.lstsq(wrapped, points)[0]
    found = points - wrapped @ periodic.least_squares(knots, count, points, u)
    assert np.sum(found**2) == pytest.approx(np.sum(best**2), rel=1e-5)


def test_foot_points_are_nearest_points():
    angle = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    circle = 50 * np.column_stack([np.cos(angle), np.sin(angle)])
    breaks = np.arange(12) * 2 * np.pi / 12
    knots = extend_knots(breaks, 2 * np.pi)
    control = periodic.least_squares(knots, 12, circle, angle)
    rng = np.random.default_rng(0)
    away = rng.uniform(-5, 5, 60)
    started = np.sort(angle + rng.uniform(-0.04, 0.04, 60)) % (2 * np.pi)
    order = np.argsort(started)
    points = (circle * (1 + away[:, None] / 50))[order]
    parameters = started[order]
    distance = periodic.project(knots, control, points, parameters, 8)
    assert distance == pytest.approx(np.abs(away[order]), abs=0.02)
    assert np.all(np.diff(parameters) >= 0)


def test_three_rounds_of_sliding_along_tangents_are_as_near_as_any_number():
    angle = np.linspace(0, 2 * np.pi, 400, endpoint=False)
    shape = np.column_stack([80 * np.cos(angle), 30 * np.sin(angle) + 8 * np.sin(3 * angle)])
    step = np.linalg.norm(np.roll(shape, -1, axis=0) - shape, axis=1)
    start, period = np.cumsum(step) - step, step.sum()
    knots = extend_knots(np.arange(14) * period / 14, period)

    def rounds(count):
        u = start.copy()
        control = periodic.least_squares(knots, 14, shape, u)
        distance = periodic.project(knots, control, shape, u, 4)
        for _ in range(count):
            control = periodic.tangent_least_squares(knots, control, shape, np.ones(400), u, 0.03)
            distance = periodic.project(knots, control, shape, u, 4)
        return np.sqrt(np.mean(distance**2))

    assert rounds(3) == pytest.approx(rounds(40), rel=0.02)
    assert rounds(40) < 0.034  # of an outline 80 long


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(4, 30), st.booleans())
def test_evaluation_agrees_with_scipy_and_closes(seed, count, repeated):
    knots, control, _ = random_spline(seed, count, repeated)
    assert len(knots) == count + 7
    curve = BSpline(knots, np.vstack([control, control[:3]]), 3)
    u = np.linspace(knots[3], knots[-4], 101)[:-1]
    assert evaluate_spline(knots, control, u) == pytest.approx(curve(u), abs=1e-9)
    assert curve(knots[3]) == pytest.approx(curve(knots[-4]), abs=1e-9)
