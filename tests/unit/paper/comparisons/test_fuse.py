import numpy as np
import pytest
from support.known_curves import bean, circle

from cccd_paper.comparisons.baselines.reconstructions import reconstruct
from cccd_paper.comparisons.fuse import (
    closed_spline,
    near_boundary,
    order_by_angle,
    order_by_chain,
    order_by_links,
)


def is_ring_order(order: np.ndarray) -> bool:
    """Whether numbers come in cyclic order, in either sense."""
    return set(np.diff(np.r_[order, order[:1]]) % len(order)) in ({1}, {len(order) - 1})


@pytest.mark.parametrize("seed", range(5))
def test_every_order_finds_a_star_shaped_curve(seed):
    curve = bean(60)
    shuffle = np.random.default_rng(seed).permutation(60)
    corners = curve[shuffle]
    assert is_ring_order(shuffle[order_by_angle(corners)])
    assert is_ring_order(shuffle[order_by_chain(corners, curve)])
    assert is_ring_order(shuffle[order_by_links(corners, lambda points: reconstruct("tour", points))])


def test_only_the_angle_fails_on_a_spiral():
    # A thick horseshoe turns by more than a whole circle as seen from its centroid.
    angle = np.linspace(0, 1.8 * np.pi, 60)
    out, back = 40 * np.exp(1j * angle), 30 * np.exp(1j * angle[::-1])
    curve = np.concatenate([out, back])
    curve = np.column_stack([curve.real, curve.imag])
    shuffle = np.random.default_rng(0).permutation(len(curve))
    assert not is_ring_order(shuffle[order_by_angle(curve[shuffle])])
    assert is_ring_order(shuffle[order_by_chain(curve[shuffle], curve)])
    assert is_ring_order(shuffle[order_by_links(curve[shuffle], lambda points: reconstruct("tour", points))])


def test_the_spline_of_a_regular_polygon_is_nearly_a_circle():
    # At its knots a uniform cubic takes (1, 4, 1) / 6 of its control points.
    points = closed_spline(circle(12, radius=30.0, centre=(0.0, 0.0)))
    radius = np.hypot(*points.T)
    assert radius[::8] == pytest.approx(30 * (4 + 2 * np.cos(np.pi / 6)) / 6)
    assert np.ptp(radius) < 0.01


def test_the_spline_moves_with_its_control_points():
    control = bean(20)
    turn = np.array([[0.6, -0.8], [0.8, 0.6]])
    np.testing.assert_allclose(closed_spline(control @ turn + 5), closed_spline(control) @ turn + 5)


def test_two_points_make_no_closed_spline():
    with pytest.raises(ValueError, match="three control points"):
        closed_spline(np.zeros((2, 2)))


def test_near_boundary_counts_the_eight_neighbours():
    boundary = np.array([[10, 10]])
    corners = np.array([[10, 10], [11, 11], [9, 10], [12, 10], [30, 30]])
    np.testing.assert_array_equal(near_boundary(corners, boundary), [True, True, True, False, False])
    assert near_boundary(np.zeros((0, 2)), boundary).shape == (0,)
