"""Contours of a level: their areas, how they nest, what they share, and how levels are linked."""

import itertools

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from cccd.geometry.polygons import resample, signed_area
from cccd.surface.fields import LevelField
from cccd.surface.ring_graph import DOWN, UP, link_rings
from cccd.surface.rings import find_rings, overlap

ROW, COLUMN = np.indices((64, 56), float)


def discs(*circles, spacing=(1.0, 1.0)):
    """Distance in mm to the union of discs (i, j, radius) in mm."""
    away = [np.hypot(ROW * spacing[0] - i, COLUMN * spacing[1] - j) - radius for i, j, radius in circles]
    return np.min(away, axis=0).astype(np.float32)


def level_of(distance, level=0, spacing=(1.0, 1.0), of_pixels=False):
    return find_rings(LevelField(float(level), distance, level), level, np.array(spacing), of_pixels)


@pytest.mark.parametrize("spacing", [(1.0, 1.0), (0.5, 0.8)])
def test_a_circle_has_its_area_and_radius(spacing):
    centre = np.array([30.0, 28.0]) * spacing
    (ring,) = level_of(discs((*centre, 12.0), spacing=spacing), spacing=spacing)
    assert ring.area == pytest.approx(np.pi * 12**2, rel=3e-3)
    assert signed_area(ring.points) == pytest.approx(ring.area)
    assert np.hypot(*(ring.points - centre).T) == pytest.approx(12, abs=0.02)
    assert (ring.hole, ring.depth) == (False, 0)


def test_a_ring_of_pixels_stands_for_the_pixels_inside():
    distance = discs((15, 22, 11.3), spacing=(0.5, 0.8))
    (ring,) = level_of(distance, spacing=(0.5, 0.8), of_pixels=True)
    assert ring.area == pytest.approx(np.count_nonzero(distance < 0) * 0.4)
    whole = np.zeros(distance.shape, bool)
    whole[tuple(map(slice, ring.bbox_min, ring.bbox_max))] = ring.mask
    assert np.array_equal(whole, distance < 0)


def test_rings_in_rings_are_nested_one_deeper_each():
    radius = np.hypot(ROW - 32, COLUMN - 28)
    shells = np.minimum(np.maximum(radius - 25, 18 - radius), np.maximum(radius - 8, 3 - radius))
    rings = level_of(shells.astype(np.float32))
    assert [(ring.depth, ring.hole) for ring in rings] == [(0, False), (1, True), (2, False), (3, True)]
    assert [np.sqrt(ring.area / np.pi) for ring in rings] == pytest.approx([25, 18, 8, 3], abs=0.1)
    assert all(signed_area(ring.points) > 0 for ring in rings)


def test_rings_beside_each_other_are_not_nested():
    larger, smaller = level_of(discs((15, 20, 9), (45, 30, 12)))
    assert (larger.depth, smaller.depth) == (0, 0)
    assert larger.area > smaller.area
    assert overlap(larger, smaller) == 0


def test_contours_around_no_pixel_centre_are_left_out():
    assert level_of(discs((20.5, 20.5, 0.3))) == []


@settings(deadline=None)
@given(st.floats(0, 25), st.floats(0, 2 * np.pi))
def test_overlap_counts_the_pixels_in_both(apart, angle):
    first = discs((30.1, 26.2, 10.3))
    second = discs((30 + apart * np.cos(angle), 26 + apart * np.sin(angle), 7.1))
    (a,), (b,) = level_of(first), level_of(second)
    assert overlap(a, b) == overlap(b, a) == np.count_nonzero((first < 0) & (second < 0))


@settings(deadline=None)
@given(st.lists(st.floats(2, 9), min_size=4, max_size=20), st.integers(5, 90))
def test_areas_and_resampling_of_star_shaped_polygons(radii, count):
    angle = 2 * np.pi * np.arange(len(radii)) / len(radii)
    points = 20 + np.array(radii)[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    polygon = shapely.Polygon(points)
    assert signed_area(points) == pytest.approx(polygon.area)
    assert signed_area(points[::-1]) == pytest.approx(-polygon.area)
    spaced = resample(points, count)
    along = [polygon.exterior.distance(shapely.Point(point)) for point in spaced]
    assert max(along) < 1e-9
    steps = np.hypot(*(np.roll(spaced, -1, axis=0) - spaced).T)
    assert steps.max() <= polygon.length / count + 1e-9  # chords are no longer than the steps of arc length


def test_a_ring_that_moves_a_little_runs_on_through_all_levels():
    levels = [level_of(discs((25 + k, 26, 9 + 0.2 * k)), k) for k in range(12)]
    graph = link_rings(levels)
    (chain,) = graph.chains()
    assert [ring.level for ring in chain] == list(range(12))
    for below, above in itertools.pairwise(chain):
        assert graph.next(below, UP) is above
        assert graph.next(above, DOWN) is below
    assert graph.path(chain[3], UP, most=4) == chain[3:7]
    assert graph.path(chain[3], DOWN) == chain[3::-1]


def test_where_a_ring_splits_the_larger_part_runs_on_and_the_other_touches():
    whole = level_of(discs((20, 26, 12), (40, 26, 9)), 0)
    parts = level_of(discs((18, 26, 11), (43, 26, 8)), 1)
    graph = link_rings([whole, parts])
    larger, smaller = parts
    assert graph.next(whole[0], UP) is larger
    assert graph.touched(whole[0], UP) == [smaller]
    assert graph.touched(smaller, DOWN) == [whole[0]]
    assert graph.next(smaller, DOWN) is None
    assert len(graph.chains()) == 2


def test_a_hole_does_not_continue_what_fills_it():
    ringed = level_of(np.abs(np.hypot(ROW - 30, COLUMN - 26) - 10).astype(np.float32) - 4, 0)
    disc = level_of(discs((30, 26, 5)), 1)
    graph = link_rings([ringed, disc])
    assert not any(graph.next(ring, UP) or graph.touched(ring, UP) for ring in ringed if ring.hole)
