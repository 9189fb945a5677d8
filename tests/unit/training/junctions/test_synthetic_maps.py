import numpy as np
import pytest

from cccd.geometry.opencv import border_pixels
from cccd_datasets.corruptions import KINDS, corrupt
from cccd_junctions.decoding import fill_inside
from cccd_junctions.delaunay import build_graph
from cccd_training.junctions.labels import inside_shares, link_labels
from cccd_training.junctions.random_masks import draw_mask
from cccd_training.junctions.synthetic_maps import draw_map, truth_mask


def square(size=21):
    mask = np.zeros((60, 60), np.uint8)
    mask[15 : 15 + size, 20 : 20 + size] = 1
    return mask


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "clean"])
def test_corruption_changes_the_map_and_severity_the_amount(kind):
    mask = draw_mask(np.random.default_rng(11))
    clean = corrupt(np.random.default_rng(0), mask, "clean")
    changed = {
        severity: np.mean([
            (corrupt(np.random.default_rng(n), mask, kind, severity) ^ clean).sum() for n in range(8)
        ])
        for severity in (0.3, 3.0)
    }  # fmt: skip
    assert 0 < changed[0.3] < changed[3.0]


def test_gaps_only_remove_and_spurs_only_add():
    mask = draw_mask(np.random.default_rng(11))
    clean = corrupt(np.random.default_rng(0), mask, "clean")
    rng = np.random.default_rng(1)
    assert not (corrupt(rng, mask, "gaps") & ~clean).any()
    assert not (clean & ~corrupt(rng, mask, "spurs")).any()


def test_a_map_without_corruption_is_the_masks_border():
    mask = square()
    drawn = corrupt(np.random.default_rng(0), mask, "clean")
    inner = np.zeros_like(mask)
    inner[16:35, 21:40] = 1
    assert np.array_equal(drawn, (mask > 0) & (inner == 0))


def test_shares_of_a_square_add_up_to_its_area():
    contours = border_pixels(square())
    pixels = np.unique(np.vstack([contours[0], [[3, 3], [50, 50], [25, 25]]]), axis=0)
    graph = build_graph(pixels)
    shares = inside_shares(graph, contours)
    assert (shares * graph.areas).sum() == pytest.approx(400, rel=0.02)


def test_true_links_of_a_clean_map_are_its_chain():
    contour = border_pixels(square())[0]
    graph = build_graph(contour)
    true = graph.links[link_labels(graph, inside_shares(graph, [contour]))]
    wanted = {tuple(sorted((n, (n + 1) % len(contour)))) for n in range(len(contour))}
    assert {tuple(sorted(link)) for link in true.tolist()} == wanted


@pytest.mark.parametrize("kind", ["clean", "spurs", "bridges", "blocks", "pinch", "noise"])
def test_true_labels_decode_to_the_truth(kind):
    sample = draw_map(np.random.default_rng(8), kind, 1.0)
    graph = build_graph(sample.pixels)
    masks, origin = fill_inside(graph, inside_shares(graph, sample.contours) > 0.5)
    truth = truth_mask(sample)
    placed = np.zeros(np.maximum(truth.shape, origin + masks.shape[1:]), bool)
    placed[origin[0] :, origin[1] :][: masks.shape[1], : masks.shape[2]] = masks[0]
    placed = placed[: truth.shape[0], : truth.shape[1]]
    assert 2 * (placed & (truth > 0)).sum() / (placed.sum() + truth.sum()) > 0.99
