import numpy as np
import pytest
import torch
from test_inference import SHIPPED, dumbbell, logits_of, raster_order

from cccd.geometry.opencv import border_pixels
from cccd_junctions.alternatives import FEATURES, SMALLEST_PX, alternatives, describe, pieces
from cccd_junctions.checkpoint import load_model
from cccd_junctions.delaunay import build_graph
from cccd_junctions.energy import energy_weights, inference_energy, least_energy
from cccd_junctions.inference import read_slices
from cccd_junctions.reranking import Reranker, shipped_reranker
from cccd_junctions.stacks import label_slices
from cccd_training.junctions.reranker import Example, draw_examples, train_reranker
from cccd_training.junctions.scoring import score_labels
from cccd_training.junctions.synthetic_maps import draw_map


def all_labels(graph, logits):
    energy = inference_energy(graph, logits)
    cut = least_energy(graph, energy)
    return energy, alternatives(graph, energy, energy_weights(graph), cut)


def features_of(mask, inside_of_graph):
    """Features of one labelling of a mask's outline."""
    graph = build_graph(raster_order(np.vstack(border_pixels(mask))))
    logits = np.zeros(len(graph.triangles)), np.full(len(graph.links), 5.0)
    labels = inside_of_graph(graph)[None]
    found = describe(graph, logits, inference_energy(graph, logits), labels)
    return dict(zip(FEATURES, found[0], strict=True))


def test_a_doubtful_neck_is_an_alternative_and_makes_one_piece_of_two():
    mask, _, seen = dumbbell()
    graph = build_graph(raster_order(seen))
    logits = logits_of(graph, mask, (40, 69))
    energy, labels = all_labels(graph, logits)
    parts, holes = pieces(describe(graph, logits, energy, labels))
    assert parts[0] == 2
    assert 1 in parts[1:]
    assert (holes == 0).all()


def test_every_alternative_changes_one_zone_of_the_cut_and_none_comes_twice():
    rng = np.random.default_rng(3)
    mask, _, seen = dumbbell(9)
    graph = build_graph(raster_order(seen))
    within, link = logits_of(graph, mask, (40, 69))
    _, labels = all_labels(graph, (within + rng.normal(0, 2, len(within)), link))
    assert len(labels) > 3
    assert len(np.unique(labels, axis=0)) == len(labels)
    first, second = graph.link_triangles.T
    for zone in labels[1:] ^ labels[0]:
        assert graph.areas[zone & ~graph.outer].sum() >= SMALLEST_PX
        reached = np.zeros(len(zone), bool)
        reached[np.flatnonzero(zone)[0]] = True
        joined = zone[first] & zone[second]
        for _ in range(len(zone)):
            reached[first[joined & reached[second]]] = True
            reached[second[joined & reached[first]]] = True
        assert np.array_equal(reached, zone)


def test_a_ring_is_one_part_with_a_hole_of_its_area_and_turns_once_along_either_border():
    i, j = np.indices((101, 101)) - 50
    ring = ((np.hypot(i, j) < 40) & (np.hypot(i, j) > 20)).astype(np.uint8)
    found = features_of(ring, lambda graph: graph.depths[:, 0] == 1)
    assert np.sinh(found["parts"]) == pytest.approx(1)
    assert np.sinh(found["holes"]) == pytest.approx(1)
    assert np.sinh(found["area"]) == pytest.approx(np.pi * (39.5**2 - 20.5**2), rel=0.003)
    assert np.sinh(found["turn"]) == pytest.approx(4 * np.pi)
    assert found["seen"] == pytest.approx(np.arcsinh(1))


def test_a_saw_turns_more_than_a_disc():
    i, j = np.indices((101, 101)) - 50
    angle = np.arctan2(i, j)
    saw = (np.hypot(i, j) < 35 + 6 * np.sin(9 * angle)).astype(np.uint8)
    disc = (np.hypot(i, j) < 35).astype(np.uint8)
    rough, smooth = (features_of(mask, lambda graph: graph.depths[:, 0] == 1) for mask in (saw, disc))
    assert rough["bend"] > smooth["bend"] + 0.5
    assert rough["turn"] > smooth["turn"]


def test_the_cut_itself_changes_nothing():
    mask, _, seen = dumbbell()
    graph = build_graph(raster_order(seen))
    logits = logits_of(graph, mask, (40, 69))
    energy, labels = all_labels(graph, logits)
    found = describe(graph, logits, energy, labels)
    about = ("lost", "gained", "joined", "left", "cost")
    changes = [n for n, name in enumerate(FEATURES) if name.split()[0] in about]
    assert (found[0, changes] == 0).all()
    assert (np.abs(found[1:, changes]).sum(axis=1) > 0).all()


def test_four_of_five_damaged_maps_are_read_without_a_mistake_and_the_wrong_ones_are_more_doubtful():
    model = load_model(SHIPPED)
    rng = np.random.default_rng(77)
    maps = [draw_map(rng, kind, 2.0) for kind in ("pinch", "gaps", "double", "thick") for _ in range(25)]
    read = read_slices([drawn.pixels for drawn in maps], [drawn.image for drawn in maps], model)
    labelled = label_slices(read, 2 * np.arange(len(read)))
    right = np.array([
        score_labels(one.graph, found.inside, drawn.contours).correct
        for one, found, drawn in zip(read, labelled, maps, strict=True)
    ])  # fmt: skip
    assert np.mean(right) >= 0.8
    doubts = np.array([found.uncertainty for found in labelled])
    assert np.mean(doubts[~right][:, None] > doubts[right]) > 0.75


def test_training_finds_what_tells_right_from_wrong_and_its_file_comes_back(tmp_path):
    rng = np.random.default_rng(0)
    examples = []
    for _ in range(400):
        features = rng.normal(0, 1, (rng.integers(2, 6), len(FEATURES))).astype(np.float32)
        correct = features[:, 7] == features[:, 7].max()
        apart = 50 * (1 - np.eye(len(features), dtype=np.float32))
        examples.append(Example(features, correct, correct.astype(np.float32), apart))
    train_reranker(examples, 15, 1).save(tmp_path / "weights.npz")
    trained = Reranker.load(tmp_path / "weights.npz")
    found = [example.correct[trained.scores(example.features).argmax()] for example in examples]
    assert np.mean(found) > 0.9


def test_examples_are_the_same_for_a_seed():
    torch.set_num_threads(1)
    once, again = (draw_examples(load_model(SHIPPED), 5, 0) for _ in range(2))
    assert len(once) == len(again) > 0
    for one, other in zip(once, again, strict=True):
        np.testing.assert_array_equal(one.features, other.features)
        np.testing.assert_array_equal(one.correct, other.correct)
        assert one.features.shape == (len(one.correct), len(shipped_reranker().mean))
