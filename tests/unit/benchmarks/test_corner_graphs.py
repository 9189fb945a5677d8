import numpy as np
import pytest
from corner_graph_data import corner_data, dense_matrices, draw_graph, draw_splits, is_right, number_corners

from cccd.containers import Frame
from cccd.contours import trace_stack

FRAME = Frame(np.eye(4), 2, (60, 60, 3))
RINGS = [np.array([3, 7, 1, 9]), np.array([0, 2, 5])]


def graph(count=12, seed=0):
    return draw_graph(RINGS, count, np.random.default_rng(seed))


def test_corners_of_a_data_set_have_one_numbering():
    i, j = np.indices((60, 60)) - 30
    curves = trace_stack(np.stack([np.hypot(i, j) < radius for radius in (12, 17, 22)]), (0, 0, 0), FRAME)
    points, slices = number_corners(curves, 7)
    assert len(np.unique(points, axis=0)) == len(points)
    assert len(slices) == len(np.unique(curves.slice))
    for rings in slices:
        for ring in rings:
            assert (curves.points[:, None] == points[ring]).all(axis=2).any(axis=0).all()


def test_every_corner_has_two_true_links_and_as_many_random_ones_are_added():
    drawn = graph()
    degree = np.bincount(drawn.links[drawn.true].ravel(), minlength=12)
    assert degree.tolist() == [2 if n in (0, 1, 2, 3, 5, 7, 9) else 0 for n in range(12)]
    assert drawn.true.sum() == (~drawn.true).sum() == 7
    assert np.flatnonzero(drawn.present).tolist() == [0, 1, 2, 3, 5, 7, 9]
    keys = np.sort(drawn.links, axis=1) @ (12, 1)
    assert len(np.unique(keys)) == len(keys)


def test_true_scores_leave_the_outlines_and_others_do_not():
    drawn = graph()
    assert is_right(drawn, np.where(drawn.true, 1.0, -1.0))
    assert not is_right(drawn, np.where(drawn.true, -1.0, 1.0))


def test_splits_share_no_slice():
    slices = [[np.arange(5) + 5 * n] for n in range(12)]
    splits = draw_splits(slices, 60, {"training": 20, "validation": 4, "test": 5}, 0)
    assert {split: len(graphs) for split, graphs in splits.items()} == {
        "training": 20,
        "validation": 4,
        "test": 5,
    }
    seen = [{int(np.flatnonzero(one.present)[0]) for one in graphs} for graphs in splits.values()]
    assert sum(map(len, seen)) == len(set.union(*seen))


@pytest.mark.parametrize("places", [False, True])
def test_graphs_have_the_printed_features_and_dense_matrices_the_same_links(places):
    drawn = graph()
    points = np.random.default_rng(0).uniform(0, 100, (12, 2)) if places else None
    data = corner_data(drawn, points)
    assert data.x[:, 0].tolist() == np.where(drawn.present, 1, -1).tolist()
    assert data.x.abs().max() <= 1
    adjacency, target = dense_matrices(drawn)
    assert np.array_equal(adjacency, adjacency.T)
    assert set(map(tuple, np.argwhere(adjacency))) == set(map(tuple, data.edge_index.T.tolist()))
    assert target.sum() == 2 * drawn.true.sum()
