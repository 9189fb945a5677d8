from dataclasses import replace

import numpy as np
from test_inference import FRAME, SHIPPED, boundaries, raster_order
from test_stacks import clear, disc

from cccd.containers import Curves, FittedCurves, Splines
from cccd.geometry.opencv import border_pixels
from cccd.settings.junctions import InferenceSettings
from cccd_junctions.alternatives import FEATURES
from cccd_junctions.checkpoint import load_model
from cccd_junctions.delaunay import build_graph
from cccd_junctions.labelling import label_slice
from cccd_junctions.ordering import order_boundaries
from cccd_junctions.reranking import shipped_reranker
from cccd_junctions.uncertainty import CALIBRATED_WEIGHTS, chance_of_error, doubt_facts, listed_from
from cccd_training.junctions.reranker import Example, fit_doubt
from cccd_training.junctions.synthetic_maps import draw_map
from cccd_workflow import stage_files
from cccd_workflow.curve_measures import doubtful_slices


def two_circles(gap, doubt):
    """A map of two circles, ``gap`` pixels apart, between which the network has ``doubt`` nats for inside."""
    chains = [border_pixels(disc(radius))[0] for radius in (25, 25 + gap)]
    line = np.column_stack([np.arange(2, 8), np.full(6, 45)])  # without it the map were a ring's outline
    graph = build_graph(np.unique(np.vstack([*chains, line]), axis=0))
    centre = np.hypot(*(graph.points[graph.triangles].mean(axis=1) - 45).T)
    within = np.where(centre < 24.5, 3.0, np.where(centre < 24.5 + gap, doubt, -3.0))
    return graph, (within, np.zeros(len(graph.links)))


def chance(gap, doubt):
    return label_slice(*two_circles(gap, doubt)).uncertainty


def test_a_ring_that_hangs_on_a_few_nats_is_more_doubtful_than_one_of_which_the_network_is_sure():
    for gap in (4, 8):
        for doubt in (0.3, -0.3):
            assert chance(gap, doubt) > 2 * chance(gap, 10 * doubt)


def test_what_is_expected_to_change_is_the_mean_over_likely_labellings():
    apart = np.array([0, 0, 10, 1e6])
    scores = np.array([*np.log([0.5, 0.25, 0.25]), -np.inf])
    facts = doubt_facts(scores, 1.5, apart, 4.0)
    np.testing.assert_allclose(facts, [np.log(11) / 4, 4, 1.5])


def test_more_expected_change_is_more_chance_of_error_and_a_better_cut_of_a_larger_organ_is_less():
    change, size, score = shipped_reranker().doubt[:-1]
    assert change > 0
    assert size < 0
    assert score < 0


def test_the_fit_finds_the_curve_that_errors_were_drawn_from():
    rng = np.random.default_rng(4)
    blank = shipped_reranker()
    first = replace(blank, weights=[np.eye(len(FEATURES), 1, dtype=np.float32)], biases=[np.zeros(1)])
    drawn_from = np.array([0.8, -0.7, -0.5, 1.0])
    examples, facts = [], []
    for _ in range(6000):
        features = blank.mean + blank.spread * rng.normal(0, 1, (2, len(FEATURES)))
        scores = first.scores(features)
        apart = np.exp(rng.uniform(0, 9)) * (1 - np.eye(2))
        size = features[0, FEATURES.index("size")]
        facts.append(doubt_facts(scores, scores[0], apart[scores.argmax()], size))
        wrong = rng.random() < chance_of_error(facts[-1], drawn_from)
        examples.append(Example(features, np.full(2, not wrong), np.ones(2), apart))
    fitted, true = (
        chance_of_error(np.array(facts), curve) for curve in (fit_doubt(first, examples), drawn_from)
    )
    assert np.std(true) > 0.15
    assert np.abs(fitted - true).mean() < 0.02


def test_without_alternatives_nothing_is_said_of_errors():
    assert label_slice(*two_circles(6, 0.3), rerank=False).uncertainty is None


class _Network:
    """Sure of the inner of two circles on even slices, and of nothing on odd ones."""

    def logits(self, slices):
        found = []
        for observed in slices:
            graph = observed.graph
            away = np.hypot(*(graph.points[graph.triangles].mean(axis=1) - 45).T)
            between = (away > 24.5) & (away < 32.5)
            sure = len(graph.points) % 2 == 0
            within = np.where(between, -9.0 if sure else 0.3, np.where(away < 25, 9.0, -9.0))
            found.append((within, np.full(len(graph.links), 9.0 if sure else 0.0)))
        return found


def test_doubtful_slices_are_listed_and_their_uncertainty_is_stored(tmp_path):
    line = np.column_stack([np.arange(2, 10), np.full(8, 45)])
    pixels = raster_order(np.vstack([border_pixels(disc(radius))[0] for radius in (25, 33)] + [line]))
    even = pixels if len(build_graph(pixels).points) % 2 == 0 else np.vstack([pixels, [(0, 45)]])
    odd = np.vstack([even, [(0, 50)]])
    plain = raster_order(border_pixels(clear(20)[1])[0])
    curves, report = order_boundaries(boundaries([even, odd, plain], [0, 10, 20]), _Network())
    assert report["doubtful"] == [10]
    assert report["unlisted_wrong"] is None  # the guarantee is for the shipped weights
    (warning,) = doubtful_slices(report)
    assert "10 (1 of 3;" in warning
    assert "of the others" not in warning
    chance = dict(zip(curves.slice.tolist(), curves.uncertainty.tolist(), strict=True))
    assert chance[10] > listed_from(InferenceSettings().unlisted_wrong) > chance[0] >= chance[20]
    splines = Splines(
        curves.points, curves.offsets, np.arange(5.0), np.zeros(len(curves) + 1, np.int64),
        curves.slice, curves.hole, 3, FRAME,
    )  # fmt: skip
    stage_files.write_contours(tmp_path / "contours.h5", curves, report)
    read = stage_files.read_curves(tmp_path / "contours.h5")
    codes = np.zeros(len(read.points), np.uint8)
    stage_files.write_curves(
        tmp_path / "curves.h5", FittedCurves(read, codes, read.points, read.offsets, splines, {})
    )
    np.testing.assert_array_equal(
        stage_files.read_curves(tmp_path / "curves.h5").uncertainty, curves.uncertainty
    )


def test_a_stricter_share_lists_more_and_the_shipped_weights_are_those_of_the_guarantee():
    model = load_model(SHIPPED)
    assert model.weights_sha256 == CALIBRATED_WEIGHTS
    kinds = ("double", "spurs", "mixed", "gaps")
    drawn = [draw_map(np.random.default_rng([5, n]), kinds[n % 4], 1.0).pixels for n in range(8)]
    maps = boundaries([raster_order(pixels) for pixels in drawn], range(0, 80, 10))
    listed = []
    for share in (0.0, 0.1, 0.2, 0.3):
        _, report = order_boundaries(maps, model, settings=InferenceSettings(unlisted_wrong=share))
        assert report["unlisted_wrong"] == share
        listed.append(set(report["doubtful"]))
    assert listed[0] == set(range(0, 80, 10))
    assert listed[0] > listed[2] >= listed[3]
    assert listed[0] >= listed[1] >= listed[2]


def test_traced_curves_have_no_uncertainty_and_the_decoder_alone_none_either(tmp_path):
    curves, report = order_boundaries(boundaries([raster_order(border_pixels(disc(20))[0])]), None)
    assert curves.uncertainty is None
    assert doubtful_slices(report) == []
    stage_files.write_contours(tmp_path / "contours.h5", curves, report)
    assert isinstance(back := stage_files.read_curves(tmp_path / "contours.h5"), Curves)
    assert back.uncertainty is None
