import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from cccd.geometry.polygons import RaggedPolygons


def test_areas_perimeters_and_neighbours_of_ragged_polygons():
    square = np.array([(0, 0), (0, 4), (4, 4), (4, 0)], float)
    polygons = RaggedPolygons.of([square, square[::-1] / 2 + 1e6, square[:0], square[:3]])
    turn = np.sign(polygons.signed_areas)[0]
    assert (turn * polygons.signed_areas).tolist() == [16, -4, 0, 8]
    assert polygons.lengths == pytest.approx([16, 8, 0, 8 + np.sqrt(32)])
    following, preceding = polygons.successors, polygons.predecessors
    assert following.tolist() == [1, 2, 3, 0, 5, 6, 7, 4, 9, 10, 8]
    assert np.array_equal(preceding[following], np.arange(11))


def test_simplicity_of_polygons():
    square = [(0, 0), (0, 4), (4, 4), (4, 0)]
    bow = [(0, 0), (4, 4), (0, 4), (4, 0)]
    pinched = [(0, 0), (2, 2), (4, 0), (4, 4), (2, 2), (0, 4)]
    repeated = [(0, 0), (0, 4), (0, 4), (4, 4)]
    spur = [(0, 0), (0, 4), (0, 8), (0, 4), (4, 4)]
    parts = [np.array(part, float) for part in (square, bow, pinched, repeated, spur, square[:2])]
    assert RaggedPolygons.of(parts).is_simple.tolist() == [True] + [False] * 5


def test_resampling_is_even_and_keeps_a_circle():
    angle = np.sort(np.random.default_rng(0).random(2000)) * 2 * np.pi
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    square = np.array([(0, 0), (0, 4), (4, 4), (4, 0)], float)
    even = RaggedPolygons.of([square, circle]).resample(np.array([16, 50]))
    points, offsets = even.points, even.offsets
    assert np.array_equal(points[:5], [(0, 0), (0, 1), (0, 2), (0, 3), (0, 4)])
    step = np.linalg.norm(even.steps[16:], axis=1)
    assert step == pytest.approx(2 * np.sin(np.pi / 50), rel=1e-3)
    assert np.array_equal(points[16], circle[0])
    assert offsets.tolist() == [0, 16, 66]


SIZES = st.lists(st.integers(0, 7), max_size=8)


@settings(deadline=None)
@given(SIZES, st.integers(0, 2**32 - 1))
def test_polygons_come_back_from_one_array(sizes, seed):
    rng = np.random.default_rng(seed)
    parts = [rng.normal(size=(size, 2)) for size in sizes]
    polygons = RaggedPolygons.of(parts)
    assert len(polygons) == len(parts)
    assert polygons.sizes.tolist() == sizes
    assert all(map(np.array_equal, polygons, parts))
    assert np.array_equal(polygons.points[polygons.successors][polygons.predecessors], polygons.points)
    assert np.array_equal(polygons.owners, np.repeat(np.arange(len(sizes)), sizes))
    chosen = rng.random(len(parts)) < 0.5
    wanted = [part for part, taken in zip(parts, chosen, strict=True) if taken]
    taken = polygons.take(chosen)
    assert len(taken) == len(wanted)
    assert all(map(np.array_equal, taken, wanted))
    assert all(map(np.array_equal, polygons.take(np.flatnonzero(chosen)[::-1]), wanted[::-1]))


@settings(deadline=None)
@given(st.lists(st.integers(3, 9), min_size=1, max_size=5), st.integers(0, 2**32 - 1))
def test_areas_and_lengths_are_those_of_shapely(sizes, seed):
    rng = np.random.default_rng(seed)
    polygons = RaggedPolygons.of([rng.normal(size=(size, 2)) for size in sizes])
    rings = polygons.rings()
    assert polygons.lengths == pytest.approx(shapely.length(rings))
    simple = polygons.is_simple
    assert np.array_equal(simple, shapely.is_simple(rings))
    areas = shapely.area(shapely.polygons(rings))
    assert np.abs(polygons.signed_areas[simple]) == pytest.approx(areas[simple])
    assert np.array_equal(polygons.signed_areas[simple] > 0, shapely.is_ccw(rings)[simple])
