import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.distance import pdist
from support.known_curves import bean, circle, ring_links

from cccd_paper.comparisons.baselines.reconstructions import RECONSTRUCTIONS, reconstruct
from cccd_paper.comparisons.links import count_links
from cccd_paper.comparisons.reconstruction.delaunay import triangulate

ALL = sorted(RECONSTRUCTIONS)


@pytest.mark.parametrize("method", ALL)
@pytest.mark.parametrize("count", [12, 60, 200])
def test_an_even_circle_comes_back_in_order(method, count):
    np.testing.assert_array_equal(reconstruct(method, circle(count)), ring_links(count))


@pytest.mark.parametrize("method", sorted(set(ALL) - {"gathan"}))
def test_a_dense_smooth_curve_comes_back_in_order(method):
    np.testing.assert_array_equal(reconstruct(method, bean(150)), ring_links(150))


@pytest.mark.parametrize("method", ALL)
def test_two_far_circles_stay_apart(method):
    points = np.concatenate([circle(80), circle(80, centre=(50, 400))])
    counts = count_links(reconstruct(method, points), len(points))
    if method in {"connect2d", "tour"}:  # both make one closed curve of anything, by construction
        assert counts.closed
    else:
        expected = np.concatenate([ring_links(80), ring_links(80) + 80])
        np.testing.assert_array_equal(reconstruct(method, points), expected)


@pytest.mark.parametrize("method", ALL)
@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_the_order_of_the_points_does_not_matter(method, seed):
    rng = np.random.default_rng(seed)
    points = np.unique(rng.integers(0, 25, (60, 2)), axis=0).astype(float)  # full of equal lengths
    shuffle = rng.permutation(len(points))
    places = np.sort(shuffle[reconstruct(method, points[shuffle])], axis=1)
    np.testing.assert_array_equal(places[np.lexsort(places.T[::-1])], reconstruct(method, points))


@pytest.mark.parametrize("method", ALL)
@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), count=st.integers(0, 40))
def test_links_are_pairs_of_different_points(method, seed, count):
    points = np.random.default_rng(seed).normal(size=(count, 2)) * 20
    links = reconstruct(method, points)
    assert links.shape[1] == 2
    assert (links[:, 0] < links[:, 1]).all()
    assert links.size == 0 or (links.min() >= 0 and links.max() < count)
    assert len(np.unique(links, axis=0)) == len(links)


@pytest.mark.parametrize("method", ALL)
def test_points_on_a_line_are_no_error(method):
    points = np.column_stack([np.arange(6.0), 2 * np.arange(6.0)])
    assert count_links(reconstruct(method, points), 6).connected <= 1


@pytest.mark.parametrize("method", ["connect2d", "tour"])
@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_closed_by_construction(method, seed):
    points = np.random.default_rng(seed).uniform(0, 100, (40, 2))
    assert count_links(reconstruct(method, points), 40).closed


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_connect2d_never_crosses_itself(seed):
    points = np.random.default_rng(seed).uniform(0, 100, (50, 2))
    delaunay = {tuple(edge) for edge in triangulate(points).edges.tolist()}
    assert {tuple(link) for link in reconstruct("connect2d", points).tolist()} <= delaunay


def test_connect2d_closes_a_gap_of_three_spacings():
    points = circle(60)[2:]
    np.testing.assert_array_equal(reconstruct("connect2d", points), ring_links(58))


@pytest.mark.parametrize("method", ["crawl", "hnn_crust", "peel", "gathan"])
@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_no_point_gets_a_third_link(method, seed):
    points = np.random.default_rng(seed).uniform(0, 100, (60, 2))
    assert count_links(reconstruct(method, points), 60).junctions == 0


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_nn_crust_holds_every_nearest_neighbour(seed):
    points = np.random.default_rng(seed).uniform(0, 100, (30, 2))
    distances = np.linalg.norm(points[:, None] - points, axis=2)
    np.fill_diagonal(distances, np.inf)
    nearest = np.sort(np.column_stack([np.arange(30), distances.argmin(1)]), axis=1)
    links = {tuple(link) for link in reconstruct("nn_crust", points).tolist()}
    assert {tuple(pair) for pair in nearest.tolist()} <= links


@pytest.mark.parametrize(("degrees", "linked"), [(100, True), (75, True), (40, False)])
def test_hnn_crust_links_tips_down_to_60_degrees(degrees, linked):
    half = np.radians(degrees / 2)
    side = np.arange(1, 30)[:, None] * 1.0
    one, other = side * (np.cos(half), np.sin(half)), side * (np.cos(half), -np.sin(half)) * 1.02
    tip = len(one) + len(other)
    links = {
        tuple(link) for link in reconstruct("hnn_crust", np.concatenate([one, other, [[0, 0]]])).tolist()
    }
    assert ({(0, tip), (len(one), tip)} <= links) is linked


def test_a_gap_wider_than_the_shape_misleads_nn_crust_but_not_the_tour():
    right = [(0, j) for j in range(25)] + [(0, j) for j in range(35, 61)]  # ten points are missing
    around = [(i, 60) for i in (1, 2, 3)] + [(4, j) for j in range(60, -1, -1)] + [(i, 0) for i in (3, 2, 1)]
    points = np.array(right + around, float)
    assert count_links(reconstruct("nn_crust", points), len(points)).junctions > 0
    np.testing.assert_array_equal(reconstruct("tour", points), ring_links(len(points)))


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_the_tour_of_few_points_is_near_the_shortest(seed):
    from itertools import permutations

    points = np.random.default_rng(seed).uniform(0, 10, (7, 2))
    table = np.zeros((7, 7))
    table[np.triu_indices(7, 1)] = pdist(points)
    table += table.T
    shortest = min(
        table[[0, *order], [*order, 0]].sum() for order in permutations(range(1, 7)) if order[0] < order[-1]
    )
    links = reconstruct("tour", points)
    assert shortest - 1e-9 <= table[links[:, 0], links[:, 1]].sum() <= 1.15 * shortest


def test_repeated_points_are_used_once():
    points = np.concatenate([circle(30), circle(30)[:5]])
    np.testing.assert_array_equal(reconstruct("crust", points), ring_links(30))
