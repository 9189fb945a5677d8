import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cccd.geometry.opencv import border_pixels
from cccd_junctions.delaunay import REGION_GAPS_PX, build_graph


def disc(radius: int) -> np.ndarray:
    i, j = np.mgrid[-radius - 15 : radius + 16, -radius - 15 : radius + 16]
    return (i**2 + j**2 <= radius**2).astype(np.uint8)


def ring(radius: int) -> np.ndarray:
    return np.unique(border_pixels(disc(radius))[0], axis=0)


pixel_sets = st.sets(st.tuples(st.integers(0, 12), st.integers(0, 12)), min_size=1, max_size=60)


@settings(max_examples=50, deadline=None)
@given(pixel_sets)
def test_is_a_triangulation_of_all_pixels(pixels):
    graph = build_graph(np.array(sorted(pixels)))
    assert set(graph.triangles.ravel()) == set(range(len(graph.points)))
    # Euler: V - E + F = 2 with the outer face; links beyond the outermost triangles are not listed
    border = int((graph.neighbours < 0).sum())
    assert len(graph.points) - (len(graph.links) + border) + len(graph.triangles) + 1 == 2
    hull = graph.points[graph.ghost]
    i, j = hull.T
    area = abs(np.dot(i, np.roll(j, 1)) - np.dot(j, np.roll(i, 1))) / 2
    assert graph.areas.sum() == pytest.approx(area)


def test_links_know_their_triangles_and_triangles_their_links():
    graph = build_graph(ring(9))
    for side in range(3):
        link = graph.triangle_links[:, side]
        has = link >= 0
        ends = np.sort(graph.links[link[has]], axis=1)
        opposite = np.delete(np.arange(3), side)
        assert np.array_equal(ends, np.sort(graph.triangles[has][:, opposite], axis=1))
        both = graph.link_triangles[link[has]]
        assert ((both == np.flatnonzero(has)[:, None]).sum(axis=1) == 1).all()


def test_inside_of_a_closed_chain_is_one_region_one_wall_deep():
    graph = build_graph(ring(12))
    centroid = graph.points[graph.triangles].mean(axis=1)
    inside = np.linalg.norm(centroid - graph.points[~graph.ghost].mean(axis=0), axis=1) < 10
    assert (graph.depths[inside, 0] == 1).all()
    assert len(np.unique(graph.regions[inside, 0])) == 1
    assert (graph.depths[graph.outer] == 0).all()


@pytest.mark.parametrize("missing", [1, 3, 6])
def test_a_gap_is_closed_by_walls_as_long_as_it_is(missing):
    chain = border_pixels(disc(25))[0]
    width = np.linalg.norm(chain[missing] - chain[-1])
    graph = build_graph(chain[missing:])
    middle = np.argmax(np.where(graph.outer, 0, graph.areas))
    for scale, wall in enumerate(REGION_GAPS_PX):
        assert (graph.depths[middle, scale] > 0) == (width <= wall)


def test_memory_grows_with_the_number_of_links():
    small, large = build_graph(ring(50)), build_graph(ring(400))
    per_link = [graph.nbytes / len(graph.links) for graph in (small, large)]
    assert len(large.links) > 7 * len(small.links)
    assert per_link[1] == pytest.approx(per_link[0], rel=0.01)
