import itertools

import numpy as np

from cccd_junctions.cut import minimum_cuts
from cccd_junctions.delaunay import build_graph


def energy(inside, unary, pairwise, sides):
    return unary[inside].sum() + pairwise[inside[sides[:, 0]] != inside[sides[:, 1]]].sum()


def small_graph(rng):
    return build_graph(np.unique(rng.integers(0, 4, (2, 2)), axis=0))


def test_no_labelling_is_better_than_the_cut():
    rng = np.random.default_rng(0)
    for _ in range(3):
        graph = small_graph(rng)
        cells = len(graph.triangles)
        assert cells <= 16
        unary, pairwise = rng.normal(size=cells), rng.exponential(0.5, len(graph.links))
        found = minimum_cuts([unary], pairwise, graph.neighbours, graph.triangle_links)[0]
        every = np.array(list(itertools.product([False, True], repeat=cells)))
        values = (every * unary).sum(axis=1)
        values += (
            (every[:, graph.link_triangles[:, 0]] != every[:, graph.link_triangles[:, 1]]) * pairwise
        ).sum(axis=1)
        assert np.isclose(energy(found, unary, pairwise, graph.link_triangles), values.min())


def test_without_link_costs_each_cell_goes_where_it_is_cheaper():
    rng = np.random.default_rng(1)
    graph = build_graph(np.unique(rng.integers(0, 30, (80, 2)), axis=0))
    unary = rng.normal(size=len(graph.triangles))
    found = minimum_cuts([unary], np.zeros(len(graph.links)), graph.neighbours, graph.triangle_links)[0]
    assert np.array_equal(found, unary < 0)


def test_cuts_that_go_on_from_another_are_those_from_the_start():
    rng = np.random.default_rng(2)
    graph = build_graph(np.unique(rng.integers(0, 30, (120, 2)), axis=0))
    unaries = rng.normal(size=(5, len(graph.triangles)))
    pairwise = rng.exponential(0.7, len(graph.links))
    together = minimum_cuts(unaries, pairwise, graph.neighbours, graph.triangle_links)
    for unary, found in zip(unaries, together, strict=True):
        alone = minimum_cuts([unary], pairwise, graph.neighbours, graph.triangle_links)[0]
        assert np.array_equal(found, alone)
        assert 0 < np.count_nonzero(alone) < len(alone)
