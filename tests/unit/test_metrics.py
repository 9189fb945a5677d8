import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from cccd import metrics
from cccd.containers import Curves, Frame, concatenate_ragged


def curves_of(polygons, slices, shape=(40, 40, 5)):
    points, offsets = concatenate_ragged([np.asarray(p, float) for p in polygons])
    hole = np.zeros(len(polygons), bool)
    return Curves(points, offsets, np.asarray(slices, np.int32), hole, Frame(np.eye(4), 2, shape))


# Equations 12-21 ------------------------------------------------------------------------------------


def test_printed_equations_on_hand_counted_pixels():
    truth = np.array([[1, 1, 1, 0], [1, 0, 0, 0]], bool)
    predicted = np.array([[1, 1, 0, 1], [0, 0, 0, 1]], bool)
    counts = metrics.confusion(truth, predicted)
    assert (counts.tp, counts.fp, counts.tn, counts.fn) == (2, 2, 2, 2)
    counts = metrics.Confusion(tp=30, fp=10, tn=50, fn=20)
    printed = counts.printed
    shares = [30 / 110, 10 / 110, 50 / 110, 20 / 110, 80 / 110, 30 / 110]
    assert list(printed.values()) == pytest.approx([*shares, 30 / 50, 50 / 60, 60 / 90, 30 / 60])
    assert counts.standard["precision"] == pytest.approx(30 / 40)
    assert counts.standard["recall"] == printed["PRE"]  # eq. (18) is the usual recall
    assert counts.standard["false positive rate"] == pytest.approx(1 - printed["SPEC"])


@given(st.integers(0, 2**32 - 1))
def test_identities_hold_per_slice_and_in_total(seed):
    rng = np.random.default_rng(seed)
    truth, predicted = rng.random((2, 3, 6, 5)) < rng.random()
    slices = metrics.confusion(truth, predicted, axis=(1, 2))
    whole = metrics.confusion(truth, predicted)
    assert slices.tp.sum() == whole.tp
    assert slices.tn.sum() == whole.tn == np.count_nonzero(~truth & ~predicted)
    assert whole.fp == np.count_nonzero(~truth & predicted)
    printed = whole.printed
    assert sum(printed[f"{name} rate"] for name in ("TP", "FP", "TN", "FN")) == pytest.approx(1)
    assert printed["ACC"] + printed["MC"] == pytest.approx(1)
    assert printed["JI"] == pytest.approx(printed["DSC"] / (2 - printed["DSC"]))
    assert metrics.dice(truth, predicted) == metrics.dice(predicted, truth) == printed["DSC"]
    assert metrics.jaccard(truth, truth) == 1


def test_two_empty_regions_agree_and_rates_of_nothing_are_undefined():
    nothing = np.zeros((2, 2), bool)
    assert metrics.dice(nothing, nothing) == 1
    assert np.isnan(metrics.confusion(nothing, nothing).printed["PRE"])
    with pytest.raises(ValueError, match="differ in shape"):
        metrics.dice(nothing, np.zeros((2, 3), bool))


# Rasterisation --------------------------------------------------------------------------------------


def test_centres_on_the_polygon_are_inside():
    square = [(2, 3), (2, 7), (5, 7), (5, 3)]
    expected = np.zeros((9, 10), bool)
    expected[2:6, 3:8] = True
    assert np.array_equal(metrics.rasterise_slice([square], (0, 0), (9, 10)), expected)
    assert np.array_equal(metrics.rasterise_slice([square[::-1]], (2, 3), (3, 3)), np.ones((3, 3), bool))


def test_a_hole_keeps_its_border_and_loses_its_inside():
    outer = [(0, 0), (0, 9), (9, 9), (9, 0)]
    hole = [(3, 3), (6, 3), (6, 6), (3, 6)]
    expected = np.ones((10, 10), bool)
    expected[4:6, 4:6] = False
    assert np.array_equal(metrics.rasterise_slice([outer, hole], (0, 0), (10, 10)), expected)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.booleans())
def test_agrees_with_shapely_on_random_stars(seed, on_lattice):
    rng = np.random.default_rng(seed)
    polygons = []
    for _ in range(3):
        angle = np.sort(rng.random(rng.integers(3, 30))) * 2 * np.pi
        radius = rng.uniform(2, 18, len(angle))
        star = 15 + rng.uniform(-5, 5, 2) + radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
        polygons.append(np.rint(star) if on_lattice else star)
    stack = metrics.rasterise(curves_of(polygons, [4, 6, 6]), (4, 2, 3), (3, 25, 22))
    i, j = np.meshgrid(np.arange(2, 27), np.arange(3, 25), indexing="ij")
    grid = shapely.points(i, j)
    shapes = [shapely.Polygon(polygon) for polygon in polygons]
    usable = [shape.is_valid for shape in shapes]
    if usable[0]:
        assert np.array_equal(stack[0], shapely.intersects(shapes[0], grid))
    assert not stack[1].any()
    if usable[1] and usable[2]:
        a, b = shapes[1:]
        either = shapely.contains(a, grid) ^ shapely.contains(b, grid)
        border = shapely.intersects(a.boundary, grid) | shapely.intersects(b.boundary, grid)
        assert np.array_equal(stack[2], either | border)


def test_a_disc_keeps_its_area_and_outside_parts_are_cut_off():
    angle = np.linspace(0, 2 * np.pi, 7200, endpoint=False)
    disc = 50.3 * np.column_stack([np.cos(angle), np.sin(angle)])
    half = metrics.rasterise_slice([disc], (0, -60), (60, 121))
    i, j = np.meshgrid(np.arange(60), np.arange(-60, 61), indexing="ij")
    assert np.array_equal(half, np.hypot(i, j) < 50.3)
    assert not metrics.rasterise(curves_of([disc], [9]), (0, 0, 0), (3, 4, 4)).any()
    assert metrics.rasterise_slice([], (0, 0), (2, 3)).shape == (2, 3)
