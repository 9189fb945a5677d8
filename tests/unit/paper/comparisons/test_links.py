import numpy as np
import pytest
from support.known_curves import circle, ring_links

from cccd_paper.comparisons.links import closed_order, count_links, enclosed_region, unique_links

NAMES = ("connected", "disconnected", "open_ends", "junctions", "left_out", "closed")
TWO_RINGS = np.concatenate([ring_links(4), ring_links(5) + 4])
CHORD = unique_links(np.vstack([ring_links(6), [[0, 3]]]))
#: Links, the number of their points, and what is counted, in the order of the names.
COUNTS = {
    "a ring": (ring_links(7), 7, [1, 0, 0, 0, 0, True]),
    "a missing link": (ring_links(7)[1:], 7, [1, 1, 2, 0, 0, False]),
    "two rings": (TWO_RINGS, 9, [2, 2, 0, 0, 0, False]),
    "a chord": (CHORD, 6, [1, 0, 0, 2, 0, False]),
    "two points without links": (ring_links(3), 5, [1, 0, 0, 0, 2, True]),
    "no links": (np.zeros((0, 2), int), 3, [0, 0, 0, 0, 3, False]),
}


@pytest.mark.parametrize(("links", "points", "expected"), COUNTS.values(), ids=COUNTS)
def test_links_are_counted(links, points, expected):
    counts = count_links(links, points)
    assert [getattr(counts, name) for name in NAMES] == expected


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
