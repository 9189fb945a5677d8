import cv2
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from cccd.geometry.opencv import border_pixels
from cccd_junctions.intensity import image_edges, normalised_intensity
from cccd_junctions.observation import observe


def scene():
    """A disc a little brighter than what surrounds it, and bone beside it."""
    mask = np.zeros((90, 90), np.uint8)
    cv2.circle(mask, (45, 45), 25, 1, -1)
    image = cv2.GaussianBlur(np.where(mask, 60.0, 30.0), (0, 0), 0.7)
    image[80:] = 2000
    return mask, image + np.random.default_rng(0).normal(0, 2, image.shape)


def test_edges_fill_what_a_map_leaves_open():
    mask, image = scene()
    chain = border_pixels(mask)[0]
    left, right = chain[:, 1] < 40, chain[:, 1] > 68
    pixels, missing = chain[left | right], chain[(chain[:, 1] > 42) & (chain[:, 1] < 66)]
    edges = image_edges(normalised_intensity(image, pixels), pixels)
    apart = np.linalg.norm(missing[:, None] - edges, axis=2).min(axis=1)
    assert apart.max() <= 3


def test_without_an_image_the_graph_is_the_map_alone():
    mask, _ = scene()
    chain = border_pixels(mask)[0]
    seen = observe(chain, None)
    assert seen.intensity is None
    assert np.array_equal(seen.graph.observed, ~seen.graph.ghost)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_no_edge_touches_another_or_the_map(seed):
    rng = np.random.default_rng(seed)
    image = cv2.GaussianBlur(rng.normal(0, 1, (50, 60)), (0, 0), 2)
    pixels = np.unique(rng.integers(5, 45, (80, 2)), axis=0)
    graph = observe(pixels, image).graph
    edges = graph.points[~graph.observed & ~graph.ghost]
    assert len(edges)
    apart = np.abs(edges[:, None] - np.vstack([edges, pixels])).max(axis=2)
    apart[np.arange(len(edges)), np.arange(len(edges))] = 9
    assert apart.min() >= 2


def test_a_map_may_reach_beyond_its_image_and_an_image_may_be_blank():
    chain = border_pixels(scene()[0])[0]
    _, image = scene()
    edges = image_edges(normalised_intensity(image[:, :50], chain), chain)
    assert edges[:, 1].max() < 50
    assert len(image_edges(normalised_intensity(np.ones((90, 90)), chain), chain)) == 0
