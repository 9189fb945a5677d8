import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support import ROOT, fresh

from cccd.chaincode import on_pixel_chain
from cccd.containers import Boundaries, Frame
from cccd.geometry.arrays import concatenate_ragged
from cccd.geometry.opencv import border_pixels
from cccd.settings.junctions import InferenceSettings
from cccd_junctions.checkpoint import load_model
from cccd_junctions.decoding import closed_chains, fill_inside
from cccd_junctions.delaunay import build_graph
from cccd_junctions.inference import predict_masks
from cccd_junctions.labelling import label_slice
from cccd_junctions.ordering import order_boundaries
from cccd_training.junctions.labels import inside_shares
from cccd_training.junctions.scoring import score_slice
from cccd_training.junctions.synthetic_maps import draw_map

FRAME = Frame(np.eye(4), 2, (200, 200, 50))
SHIPPED = ROOT / "workflow" / "models" / "junctions.pt"


def boundaries(maps, numbers=None):
    points, offsets = concatenate_ragged([np.asarray(m, np.int32).reshape(-1, 2) for m in maps])
    numbers = np.arange(len(maps)) if numbers is None else numbers
    return Boundaries(points.astype(np.int32), offsets, np.asarray(numbers, np.int32), FRAME)


def raster_order(chain):
    return np.unique(chain, axis=0)


def blob(hole=False):
    mask = np.zeros((90, 90), np.uint8)
    cv2.ellipse(mask, (45, 45), (30, 20), 25, 0, 360, 1, -1)
    if hole:
        cv2.circle(mask, (45, 45), 8, 0, -1)
    return mask


def curves_of(graph, inside, parts=None):
    masks, origin = fill_inside(graph, inside)
    return closed_chains(masks, origin, np.zeros(1, int), FRAME, parts)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0.05, 0.95))
def test_any_labelling_gives_closed_strictly_simple_pixel_chains(seed, share):
    rng = np.random.default_rng(seed)
    graph = build_graph(np.unique(rng.integers(0, 25, (60, 2)), axis=0))
    inside = (rng.random(len(graph.triangles)) < share) & ~graph.outer
    curves = curves_of(graph, inside)
    assert curves.polygons.is_simple.all()
    assert on_pixel_chain(curves.points, curves.offsets).all()
    assert ((curves.polygons.signed_areas < 0) == curves.hole).all()


def test_a_clean_map_is_ordered_right_even_without_a_network():
    chain = border_pixels(blob())[0]
    curves, report = order_boundaries(boundaries([raster_order(chain)], [7]), None)
    assert curves.slice.tolist() == [7]
    assert score_slice(list(curves), [chain]).correct
    assert report["unclosed"] == []


def sliver():
    mask = np.zeros((90, 90), np.uint8)
    cv2.ellipse(mask, (60, 45), (45, 40), 0, 130, 230, 1, 4)
    return mask


@pytest.mark.parametrize(("mask", "tip"), [(sliver(), 1), (blob(hole=True), 0)])
def test_an_outline_is_taken_as_it_is_whatever_the_logits_say(mask, tip):
    chains = border_pixels(mask)
    extra = [chains[0][0] - (n, 0) for n in range(1, tip + 1)] + [(2, 2), (2, 3)]  # a tip, and a speck
    graph = build_graph(raster_order(np.vstack([*chains, extra])))
    rng = np.random.default_rng(0)
    logits = rng.normal(0, 9, len(graph.triangles)), rng.normal(0, 9, len(graph.links))
    curves = curves_of(graph, label_slice(graph, logits).inside)
    assert {tuple(p) for p in curves.points.astype(int)} == {tuple(p) for p in np.vstack(chains)}


def test_a_spur_or_a_chord_makes_it_no_outline():
    chain = border_pixels(blob())[0]
    rows = np.arange(chain[:, 0].min() + 1, chain[:, 0].max())
    chord = np.column_stack([rows, np.full(len(rows), 45)])
    for extra in (chord, chord[: len(chord) // 3]):
        graph = build_graph(raster_order(np.vstack([chain, extra])))
        # the cut's say counts: the part left of the chord, or of where it would go on
        left = graph.points[graph.triangles][..., 1].max(axis=1) <= 45
        wanted = left & (graph.depths[:, 0] == 1)
        logits = np.where(wanted, 9.0, -9.0), np.full(len(graph.links), 9.0)
        assert (label_slice(graph, logits).inside == wanted).all()


def test_closed_curves_are_kept_where_the_cut_finds_nothing():
    chain = border_pixels(blob())[0]
    spur = chain[0] + np.column_stack([-np.arange(1, 9), np.zeros(8, int)])
    graph = build_graph(raster_order(np.vstack([chain, spur])))
    logits = np.full(len(graph.triangles), -9.0), np.zeros(len(graph.links))
    curves = curves_of(graph, label_slice(graph, logits).inside)
    assert score_slice(list(curves), [chain]).correct


def test_a_gap_is_bridged_by_neighbouring_pixels():
    chain = border_pixels(blob())[0]
    curves, _ = order_boundaries(boundaries([raster_order(chain[5:])]), None)
    assert on_pixel_chain(curves.points, curves.offsets).all()
    assert score_slice(list(curves), [chain]).correct


def test_slices_without_a_closed_boundary_are_reported_by_number_and_the_rest_goes_on():
    line = np.column_stack([np.arange(5, 40), np.full(35, 9)])
    chain = raster_order(border_pixels(blob())[0])
    empty = np.zeros((0, 2))
    curves, report = order_boundaries(
        boundaries([line, chain, empty, chain, [[3, 3]]], [2, 4, 5, 6, 9]), None
    )
    assert report["unclosed"] == [2, 5, 9]
    assert curves.slice.tolist() == [4, 6]


def test_isolated_corners_junctions_and_what_was_dropped_are_counted():
    chain = border_pixels(blob())[0]
    spur = chain[0] + np.column_stack([-np.arange(1, 9), np.zeros(8, int)])
    _, report = order_boundaries(boundaries([raster_order(np.vstack([chain, spur]))]), None)
    row = report["slices"][0]
    assert row["pixels"] == len(chain) + 8
    assert row["isolated_corners"] >= 1
    assert row["junctions"] >= 1
    assert row["kept"] + row["dropped"] == row["pixels"]
    assert row["dropped"] >= 8  # the spur
    assert row["bridged"] == 0


@pytest.fixture(scope="module")
def shipped():
    return load_model(SHIPPED)


def test_the_shipped_model_is_small(shipped):
    assert SHIPPED.stat().st_size <= 2e6


def test_the_shipped_model_finds_components_and_holes(shipped):
    mask = np.zeros((120, 200), np.uint8)
    mask[15:105, 10:100] = blob(hole=True)
    cv2.circle(mask, (150, 60), 22, 1, -1)
    chains = border_pixels(mask)
    curves, report = order_boundaries(boundaries([raster_order(np.vstack(chains))]), shipped)
    assert score_slice(list(curves), chains).correct
    assert (report["outer"], report["holes"]) == (2, 1)


@pytest.mark.parametrize(("kind", "share"), [("clean", 0.9), ("spurs", 0.8), ("blocks", 0.8), ("pinch", 0.8)])
def test_the_shipped_model_repairs_maps_it_was_not_trained_on(shipped, kind, share):
    rng = np.random.default_rng(987_654)
    samples = [draw_map(rng, kind, 1.0) for _ in range(16)]
    apart = 2 * np.arange(len(samples))  # no neighbours
    curves, _ = order_boundaries(boundaries([sample.pixels for sample in samples], apart), shipped)
    chains = [list(curves)[n] for n in range(len(curves))]
    scores = [
        score_slice(
            [c for c, k in zip(chains, curves.slice, strict=True) if k == 2 * n], sample.contours
        ).correct
        for n, sample in enumerate(samples)
    ]
    assert np.mean(scores) >= share


def test_neither_batch_nor_place_changes_the_result(shipped):
    rng = np.random.default_rng(3)
    maps = [draw_map(rng, "mixed", 1.0).pixels for _ in range(5)]
    together, _ = order_boundaries(boundaries(maps, range(0, 10, 2)), shipped)
    alone, _ = order_boundaries(boundaries([maps[3] + np.array([40, 17])]), shipped)
    mine = np.concatenate([c for c, k in zip(together, together.slice, strict=True) if k == 6])
    assert np.array_equal(np.add(mine, (40, 17)), alone.points)


def test_the_order_of_pixels_and_of_slices_changes_nothing(shipped):
    rng = np.random.default_rng(5)
    drawn = [draw_map(rng, kind, 1.0) for kind in ("mixed", "canny", "thick", "clean", "gaps")]
    images = [part.image for part in drawn]

    def masks(order, shuffle):
        maps = [rng.permutation(drawn[n].pixels) if shuffle else drawn[n].pixels for n in order]
        filled, origin = predict_masks(maps, shipped, [images[n] for n in order])
        return {n: np.argwhere(mask) + origin for n, mask in zip(order, filled, strict=True)}

    expected = masks(range(5), shuffle=False)
    for order, shuffle in (([3, 1, 4, 0, 2], False), (range(5), True)):
        found = masks(order, shuffle)
        assert all(np.array_equal(found[n], expected[n]) for n in range(5))


def test_the_library_orders_without_torch():
    code = "import sys; from cccd_junctions.ordering import order_boundaries; print('torch' in sys.modules)"
    assert fresh.python(code).split() == ["False"]


def test_an_image_is_read_where_its_origin_says(shipped):
    rng = np.random.default_rng(4)
    sample = draw_map(rng, "canny", 1.0)
    here, _ = order_boundaries(boundaries([sample.pixels]), shipped, sample.image[None])
    shifted = boundaries([sample.pixels + np.array([11, 5])], [30])
    there, _ = order_boundaries(shifted, shipped, sample.image[None], (30, 11, 5))
    assert np.array_equal(np.add(here.points, (11, 5)), there.points)


def dumbbell(neck=5):
    """Two squares, and a neck between them, along which the map shows nothing."""
    mask = np.zeros((60, 110), np.uint8)
    mask[15:45, 10:40] = mask[15:45, 70:100] = 1
    mask[30 - neck // 2 : 31 + neck // 2, 40:70] = 1
    chain = border_pixels(mask)[0]
    return mask, chain, chain[(chain[:, 1] < 40) | (chain[:, 1] > 69)]


def logits_of(graph, mask, doubted, sure=3.0, doubt=-0.5):
    """Sure of every triangle but those whose centre lies in doubted columns, which look outside."""
    inside = inside_shares(graph, border_pixels(mask)) > 0.5
    centre = graph.points[graph.triangles].mean(axis=1)[:, 1]
    within = np.where(inside, sure, -sure)
    within[inside & (centre > doubted[0]) & (centre < doubted[1])] = doubt
    return within, np.full(len(graph.links), 1.0)


def test_two_pieces_are_joined_where_a_row_allows_one():
    mask, chain, seen = dumbbell()
    graph = build_graph(raster_order(seen))
    for doubt in (-0.2, -0.5, -1.0):
        logits = logits_of(graph, mask, (40, 69), doubt=doubt)
        joined = curves_of(graph, label_slice(graph, logits, 1).inside, 1)
        assert score_slice(list(joined), [chain]).dice > 0.8
    assert len(curves_of(graph, label_slice(graph, logits, rerank=False).inside)) == 2


def test_a_hole_is_filled_where_a_part_is_wanted_and_stays_where_none_is():
    chains = border_pixels(blob(hole=True))
    spur = chains[0][0] + np.column_stack([-np.arange(1, 9), np.zeros(8, int)])  # no outline as it is
    graph = build_graph(raster_order(np.vstack([*chains, spur])))
    inside = inside_shares(graph, chains) > 0.5
    logits = np.where(inside, 4.0, -4.0), np.zeros(len(graph.links))
    assert len(curves_of(graph, label_slice(graph, logits, rerank=False).inside)) == 2
    (curve,) = curves_of(graph, label_slice(graph, logits, 1).inside, 1)
    assert score_slice([curve], chains[:1]).correct


def test_an_outline_of_several_parts_is_held_to_fewer_as_well():
    mask, _, _ = dumbbell()
    mask[:, 40:70] = 0
    maps = boundaries([raster_order(np.vstack(border_pixels(mask)))])
    found = [order_boundaries(maps, None, settings=InferenceSettings(parts=parts))[0] for parts in (None, 1)]
    assert [len(curves) for curves in found] == [2, 1]
