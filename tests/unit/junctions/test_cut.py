import itertools

import numpy as np

from cccd.junctions.complexes import build_complex, join_complexes
from cccd.junctions.cut import minimum_cut


def energy(inside, gain, cost, sides):
    return -gain[inside].sum() + cost[inside[sides[:, 0]] != inside[sides[:, 1]]].sum()


def small_graph(rng):
    return build_complex(np.unique(rng.integers(0, 4, (2, 2)), axis=0))


def test_no_labelling_is_better_than_the_cut():
    rng = np.random.default_rng(0)
    for _ in range(3):
        graph = small_graph(rng)
        cells = len(graph.triangles)
        assert cells <= 16
        gain, cost = rng.normal(size=cells), rng.exponential(0.5, len(graph.links))
        found = minimum_cut(gain, cost, graph.neighbours, graph.side_links, graph.triangle_offsets)
        every = np.array(list(itertools.product([False, True], repeat=cells)))
        values = -(every * gain).sum(axis=1)
        values += ((every[:, graph.sides[:, 0]] != every[:, graph.sides[:, 1]]) * cost).sum(axis=1)
        assert np.isclose(energy(found, gain, cost, graph.sides), values.min())


def test_without_link_costs_each_cell_goes_where_it_gains():
    rng = np.random.default_rng(1)
    graph = build_complex(np.unique(rng.integers(0, 30, (80, 2)), axis=0))
    gain = rng.normal(size=len(graph.triangles))
    found = minimum_cut(
        gain, np.zeros(len(graph.links)), graph.neighbours, graph.side_links, graph.triangle_offsets
    )
    assert np.array_equal(found, gain > 0)


def test_slices_do_not_influence_each_other():
    rng = np.random.default_rng(2)
    parts = [build_complex(np.unique(rng.integers(0, 30, (60, 2)), axis=0)) for _ in range(3)]
    joined = join_complexes(parts)
    gain, cost = rng.normal(size=len(joined.triangles)), rng.exponential(0.3, len(joined.links))
    together = minimum_cut(gain, cost, joined.neighbours, joined.side_links, joined.triangle_offsets)
    for n, part in enumerate(parts):
        cells = slice(*joined.triangle_offsets[n : n + 2])
        links = slice(*joined.link_offsets[n : n + 2])
        alone = minimum_cut(gain[cells], cost[links], part.neighbours, part.side_links, part.triangle_offsets)
        assert np.array_equal(together[cells], alone)
