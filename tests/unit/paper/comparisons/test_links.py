import numpy as np
import pytest
from support.known_curves import circle, ring_links

from cccd_paper.comparisons.links import closed_order, count_links, enclosed_region, unique_links


def test_a_ring_is_one_closed_curve():
    counts = count_links(ring_links(7), 7)
    assert counts.closed
    assert (counts.connected, counts.disconnected, counts.open_ends, counts.left_out) == (1, 0, 0, 0)


def test_a_missing_link_opens_the_curve():
    counts = count_links(ring_links(7)[1:], 7)
    assert not counts.closed
    assert (counts.connected, counts.disconnected, counts.open_ends) == (1, 1, 2)


def test_two_rings_are_two_disconnected_segments():
    links = np.concatenate([ring_links(4), ring_links(5) + 4])
    counts = count_links(links, 9)
    assert (counts.connected, counts.disconnected, counts.closed) == (2, 2, False)


def test_a_chord_makes_two_junctions():
    counts = count_links(unique_links(np.vstack([ring_links(6), [[0, 3]]])), 6)
    assert (counts.junctions, counts.closed, counts.disconnected) == (2, False, 0)


def test_points_without_links_are_left_out():
    counts = count_links(ring_links(3), 5)
    assert counts.left_out == 2
    assert counts.closed


def test_no_links_at_all():
    counts = count_links(np.zeros((0, 2), int), 3)
    assert (counts.connected, counts.closed, counts.left_out) == (0, False, 3)


def test_unique_links_drops_loops_and_repeats():
    np.testing.assert_array_equal(unique_links([[2, 1], [1, 2], [3, 3]]), [[1, 2]])


def test_closed_order_walks_the_ring():
    shuffled = np.array([4, 0, 2, 5, 1, 3])
    links = unique_links(np.column_stack([shuffled, np.roll(shuffled, -1)]))
    order = closed_order(links, 6)
    place = np.argsort(shuffled)[order]
    assert set(np.diff(place) % 6) in ({1}, {5})


def test_closed_order_refuses_an_open_curve():
    with pytest.raises(ValueError, match="not one closed curve"):
        closed_order(ring_links(5)[1:], 5)


def test_the_region_of_a_square_is_the_square():
    corners = np.array([[12, 23], [12, 29], [17, 29], [17, 23]], float)
    region = enclosed_region(corners, ring_links(4), (10, 20), (12, 14))
    expected = np.zeros((12, 14), bool)
    expected[2:8, 3:10] = True
    np.testing.assert_array_equal(region, expected)


def test_a_gap_lets_the_outside_in():
    points = circle(40)
    whole = enclosed_region(points, ring_links(40), (0, 0), (110, 120))
    torn = enclosed_region(points, ring_links(40)[1:], (0, 0), (110, 120))
    area, length = 20 * 40**2 * np.sin(np.pi / 20), 40 * 80 * np.sin(np.pi / 40)
    assert whole.sum() == pytest.approx(area + length / 2, rel=0.01)  # with the pixels on the line
    assert torn.sum() < 0.1 * whole.sum()
