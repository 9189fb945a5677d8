import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from cccd.chaincode import on_pixel_chain
from cccd.containers import Boundaries, Frame
from cccd.geometry.arrays import concatenate_ragged
from cccd.geometry.opencv import border_pixels
from cccd.geometry.polygons import RaggedPolygons
from cccd_junctions.ordering import order_boundaries
from cccd_paper.junctions.grid import build_grid, chain_loops, find_chains, follow_chains, keep_two
from cccd_paper.junctions.network import PaperNetwork, grid_data
from cccd_paper.junctions.training import grid_labels
from cccd_training.junctions.scoring import score_slice

FRAME = Frame(np.eye(4), 2, (60, 60, 1))


def outline():
    i, j = np.indices((60, 60))
    return border_pixels((((i - 30) / 20) ** 2 + ((j - 30) / 14) ** 2 < 1).astype(np.uint8))[0]


def network():
    torch.manual_seed(0)
    model = PaperNetwork(channels=6, dropout=0.5)
    for name, value in model.state_dict().items():
        if "running_mean" in name:
            value.normal_()
        if "running_var" in name:
            value.uniform_(0.5, 2)
    return model.eval()


def test_every_pixel_has_eight_neighbours_in_a_full_grid():
    pixels = np.stack(np.indices((5, 5)), axis=-1).reshape(-1, 2)
    grid = build_grid(pixels)
    # Figure 3: 25 nodes and 72 links
    assert grid.observed.sum() == 25
    assert len(grid.candidates) == 72
    assert len(grid.pixels) == 49
    step = np.abs(grid.pixels[grid.links[:, 0]] - grid.pixels[grid.links[:, 1]]).max(axis=1)
    assert (step == 1).all()
    assert len(np.unique(np.sort(grid.links, axis=1), axis=0)) == len(grid.links)


def test_a_link_has_one_value_whichever_of_its_pixels_comes_first():
    pixels = np.unique(np.random.default_rng(0).integers(0, 8, (20, 2)), axis=0)
    data, model = grid_data(build_grid(pixels)), network()
    assert set(data.x.unique().tolist()) == {-1, 1}
    (found,) = model.values([data])
    assert np.abs(found).max() < 1
    data.edge_label_index = data.edge_label_index.flip(0)
    np.testing.assert_allclose(model.values([data])[0], found, rtol=1e-5, atol=1e-6)


def test_grids_do_not_influence_each_other():
    rng = np.random.default_rng(1)
    grids = [build_grid(np.unique(rng.integers(0, size, (30, 2)), axis=0)) for size in (9, 14, 20)]
    model = network()
    for grid, found in zip(grids, model.link_scores(grids), strict=True):
        np.testing.assert_allclose(model.link_scores([grid])[0], found, rtol=1e-5, atol=1e-6)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(4, 14))
def test_at_most_two_links_per_pixel_and_every_curve_is_closed_and_simple(seed, size):
    rng = np.random.default_rng(seed)
    grid = build_grid(np.unique(rng.integers(0, size, (60, 2)), axis=0))
    scores = rng.normal(size=len(grid.candidates))
    kept = keep_two(grid.candidates, scores, len(grid.pixels))
    assert np.bincount(grid.candidates[kept].ravel(), minlength=1).max() <= 2
    chains, closed = follow_chains(grid.candidates[kept], len(grid.pixels))
    assert sum(map(len, chains)) == len(np.unique(grid.candidates[kept]))
    loops = find_chains(grid, scores)
    assert len(loops) <= np.count_nonzero(closed)
    for loop in loops:
        assert on_pixel_chain(loop.astype(float), np.array([0, len(loop)])).all()
        assert RaggedPolygons.of([loop.astype(float)]).is_simple.all()


@pytest.mark.parametrize("shift", [0, -1])
def test_of_three_links_of_a_pixel_the_worst_is_removed_whatever_its_sign(shift):
    links = np.array([(0, 1), (0, 2), (0, 3)])
    assert keep_two(links, np.array([0.2, 0.9, 0.5]) + shift, 4).tolist() == [False, True, True]


def test_a_chain_that_crosses_itself_is_dropped():
    block = build_grid(np.array([(0, 0), (0, 1), (1, 0), (1, 1)]))
    step = block.pixels[block.candidates[:, 1]] - block.pixels[block.candidates[:, 0]]
    scores = np.where(step[:, 0] == 0, -1.0, 1.0)  # both diagonals and both verticals
    kept = keep_two(block.candidates, scores, len(block.pixels))
    _, closed = follow_chains(block.candidates[kept], len(block.pixels))
    assert closed.tolist() == [True]
    assert find_chains(block, scores) == []


def test_the_true_links_of_a_spurred_outline_give_it_back_and_the_spur_is_dropped():
    chain = outline()
    spur = chain[0] + np.column_stack([-np.arange(1, 6), np.zeros(5, int)])
    grid = build_grid(np.unique(np.vstack([chain, spur]), axis=0))
    assert grid.has_junctions
    labels = grid_labels(grid, [chain])
    assert set(np.unique(labels)) == {-1, 1}
    (loop,) = find_chains(grid, labels.astype(float))
    assert score_slice([loop], [chain]).correct


class _First:
    """Prefers links by their place in the list, so that the spur's come before the outline's."""

    def link_scores(self, grids):
        return [-grid.pixels[grid.candidates].sum(axis=(1, 2)) for grid in grids]

    def find_loops(self, maps):
        return chain_loops(maps, self)


@pytest.mark.parametrize("spurred", [False, True])
def test_a_map_without_junctions_needs_no_network(spurred):
    chain = outline()
    extra = chain[0] + np.column_stack([-np.arange(1, 6), np.zeros(5, int)])
    pixels = np.unique(np.vstack([chain, extra]) if spurred else chain, axis=0)
    points, offsets = concatenate_ragged([pixels.astype(np.int32)])
    maps = Boundaries(points, offsets, np.zeros(1, np.int32), FRAME)
    curves, report = order_boundaries(maps, _First())
    assert len(curves) == (0 if spurred else 1)
    assert report["unclosed"] == ([0] if spurred else [])
