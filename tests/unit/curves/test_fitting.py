import numpy as np
import pytest
import shapely
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.interpolate import BSpline

from cccd.containers import Frame
from cccd.curves import corner_splines, fit_splines, sample_splines
from cccd.curves.corners import k_cosine_corners
from cccd.curves.knots import reference
from cccd.curves.measures import area_dice, distances
from cccd.settings.curves import CurveSettings
from cccd.tracing import trace_stack


def at_most(budget):
    return CurveSettings(max_control_points=budget)


def uniform_least_squares(points, count):
    """Rms distance of the points to their periodic least-squares fit with even knots."""
    link = np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1)
    u, period = np.cumsum(link) - link, link.sum()
    knots = np.arange(-3, count + 4) * period / count
    design = BSpline.design_matrix(u, knots, 3).toarray()
    wrapped = design[:, :count].copy()
    wrapped[:, :3] += design[:, count:]
    control = np.linalg.lstsq(wrapped, points)[0]
    curve = BSpline(knots, np.vstack([control, control[:3]]), 3)(np.linspace(0, period, 4000, endpoint=False))
    return np.sqrt(np.mean(shapely.distance(shapely.points(points), shapely.linearrings(curve)) ** 2))


def test_splines_follow_the_data_contract(blob):
    curves = blob(0)[1]
    splines = fit_splines(curves)
    drawn = sample_splines(splines)
    assert len(splines) == len(curves)
    for (control, knots), polygon in zip(splines, drawn, strict=True):
        assert len(knots) == len(control) + 7
        curve = BSpline(knots, np.vstack([control, control[:3]]), 3)
        begin, end = knots[3], knots[-4]
        u = begin + (end - begin) * np.arange(len(polygon)) / len(polygon)
        assert curve(u) == pytest.approx(polygon, abs=1e-8)
        assert curve(begin) == pytest.approx(curve(end), abs=1e-8)
        assert curve.derivative()(begin) == pytest.approx(curve.derivative()(end), abs=1e-7)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("tolerance", [0.3, 0.5, 1.0])
def test_tolerance_is_kept_with_few_points(blob, seed, tolerance):
    curves = blob(seed)[1]
    splines = fit_splines(curves, CurveSettings(tolerance_px=tolerance))
    drawn = sample_splines(splines, 4)
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
        away.append(distances(curves.points, curves.offsets, sample_splines(splines, 8)).mean())
        count.append(len(splines.control_points))
    assert np.all(np.diff(away) < 0)
    assert np.all(np.diff(count) >= 0)
    assert away[-1] < 0.05


@pytest.mark.parametrize("seed", range(3))
def test_a_budget_is_kept_and_beats_even_knots(blob, seed):
    curves = blob(seed, waves=0.25)[1]
    for share in (0.1, 0.05):
        splines = fit_splines(curves, at_most(share))
        counts = np.diff(splines.offsets)
        assert np.all(counts <= np.maximum(share * np.diff(curves.offsets), 4))
        drawn = sample_splines(splines, 4)
        for number, (points, count) in enumerate(zip(curves, counts, strict=True)):
            own = slice(curves.offsets[number], curves.offsets[number + 1])
            here = distances(curves.points, curves.offsets, drawn)[own]
            assert np.sqrt(np.mean(here**2)) < uniform_least_squares(points, count)
    assert np.diff(fit_splines(curves, at_most(12)).offsets).tolist() == [12] * len(curves)


@pytest.mark.parametrize("seed", [11, 12])
def test_automatic_count_is_near_the_fewest_any_fixed_count_needs(blob, seed):
    curves = blob(seed, slices=1)[1]
    smooth, _ = reference(curves.points, np.zeros(len(curves.points), bool), 0.25, 1.5, 24)

    def worst(splines):
        line = sample_splines(splines, 4).points
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
    drawn = sample_splines(splines, 8)
    for vertex in [(20, 30), (20, 99), (89, 99), (89, 30)]:
        assert np.linalg.norm(square - vertex, axis=1).min() < 0.02  # a control point on the curve
    assert np.count_nonzero(np.diff(square_knots[3:-3]) == 0) == 2 * 4
    assert len(square) <= 16
    assert np.all(np.diff(disc_knots) > 0)
    assert len(disc) <= 10
    radius = np.hypot(*(drawn.points[drawn.offsets[1] :] - 60).T)
    assert radius.mean() == pytest.approx(40, abs=0.3)
    assert np.ptp(radius) < 1
    assert area_dice(curves, drawn)[0] > 0.9998


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([None, 0.05, 0.1, 6]))
@example(1_861_228_300, None)  # knots without end
@example(305, None)  # a fold between two looks
@example(3986, None)  # knots that crowd at one place
def test_splines_never_cross_themselves_however_small_or_ragged(seed, budget):
    mask = np.random.default_rng(seed).random((2, 14, 15)) < 0.62
    curves = trace_stack(mask, (0, 0, 0), Frame(np.eye(4), 2, (60, 60, 4)))
    splines = fit_splines(curves, at_most(budget))
    drawn = sample_splines(splines, 8)
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
    drawn = sample_splines(fit_splines(curves, at_most(budget)), 20)
    assert drawn.polygons.is_simple.all()


def test_thin_walls_are_not_crossed(frame):
    mask = np.zeros((1, 60, 60), bool)
    mask[0, 10:50, 10:50] = True
    mask[0, 12:48, 12:48] = False  # a wall two pixels wide
    mask[0, 30, 12:46] = True  # and a spit within
    curves = trace_stack(mask, (0, 0, 0), frame)
    for splines in (fit_splines(curves), fit_splines(curves, at_most(0.05))):
        rings = [shapely.Polygon(line) for line in sample_splines(splines, 4)]
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


def test_nothing_and_nonsense(curves_of):
    nothing = fit_splines(curves_of())
    assert len(nothing) == len(sample_splines(nothing)) == 0
    for bad in ({"tolerance_px": 0}, {"max_control_points": 0}):
        with pytest.raises(ValueError, match="greater than 0"):
            CurveSettings(**bad)


# The paper's splines --------------------------------------------------------------------------------


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
    spline = shapely.Polygon(sample_splines(fit_splines(curves, at_most(0.1)), 8).points)
    assert to_outline(spline) > to_outline(pixels) + 0.0005
    assert dice_of(spline, pixels) > to_outline(pixels)
