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
from cccd.junctions import order_boundaries
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
    model = PaperNetwork(width=6, layers=2, dropout=0.5)
    for layer in model.layers:
        layer.norm.running_mean.normal_()
        layer.norm.running_var.uniform_(0.5, 2)
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


def test_the_network_is_equation_11_evaluated_densely():
    pixels = np.unique(np.random.default_rng(0).integers(0, 8, (20, 2)), axis=0)
    grid, model = build_grid(pixels), network()
    adjacency = np.zeros((len(grid.pixels),) * 2)
    adjacency[tuple(grid.links.T)] = adjacency[tuple(grid.links.T[::-1])] = 1
    x = np.where(grid.observed, 1.0, -1.0)[:, None]
    weights = {name: value.numpy() for name, value in model.state_dict().items()}
    for n in range(2):
        part = {name.removeprefix(f"layers.{n}."): value for name, value in weights.items()}
        sent = x @ part["dense.weight"].T + part["dense.bias"]
        sent = (sent - part["norm.running_mean"]) / np.sqrt(part["norm.running_var"] + 1e-5)
        x = adjacency @ np.maximum(sent * part["norm.weight"] + part["norm.bias"], 0)
    one, other = x[grid.candidates[:, 0]], x[grid.candidates[:, 1]]
    both = np.concatenate([one + other, np.abs(one - other)], axis=1)
    expected = np.tanh(both @ weights["link_head.weight"][0] + weights["link_head.bias"])
    np.testing.assert_allclose(model.link_scores([grid])[0], expected, rtol=1e-4, atol=1e-5)
    assert set(grid_data(grid).x.unique().tolist()) == {-1, 1}


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
    assert not kept[scores <= 0].any()
    assert np.bincount(grid.candidates[kept].ravel(), minlength=1).max() <= 2
    chains, closed = follow_chains(grid.candidates[kept], len(grid.pixels))
    assert sum(map(len, chains)) == len(np.unique(grid.candidates[kept]))
    loops = find_chains(grid, scores)
    assert len(loops) <= np.count_nonzero(closed)
    for loop in loops:
        assert on_pixel_chain(loop.astype(float), np.array([0, len(loop)])).all()
        assert RaggedPolygons.of([loop.astype(float)]).is_simple.all()


def test_a_link_gives_way_to_a_better_one():
    links = np.array([(0, 1), (0, 2), (0, 3)])
    assert keep_two(links, np.array([0.2, 0.9, 0.5]), 4).tolist() == [False, True, True]


def test_a_chain_that_crosses_itself_is_dropped():
    block = build_grid(np.array([(0, 0), (0, 1), (1, 0), (1, 1)]))
    step = block.pixels[block.candidates[:, 1]] - block.pixels[block.candidates[:, 0]]
    scores = np.where(step[:, 0] == 0, -1.0, 1.0)  # both diagonals and both verticals
    _, closed = follow_chains(block.candidates[scores > 0], len(block.pixels))
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


class _Nothing:
    def link_scores(self, grids):
        return [np.full(len(grid.candidates), -1.0) for grid in grids]

    def find_loops(self, maps):
        return chain_loops(maps, self)


@pytest.mark.parametrize("spurred", [False, True])
def test_a_map_without_junctions_needs_no_network(spurred):
    chain = outline()
    extra = chain[0] + np.column_stack([-np.arange(1, 6), np.zeros(5, int)])
    pixels = np.unique(np.vstack([chain, extra]) if spurred else chain, axis=0)
    points, offsets = concatenate_ragged([pixels.astype(np.int32)])
    maps = Boundaries(points, offsets, np.zeros(1, np.int32), FRAME)
    curves, report = order_boundaries(maps, _Nothing())
    assert len(curves) == (0 if spurred else 1)
    assert report["unclosed"] == ([0] if spurred else [])
