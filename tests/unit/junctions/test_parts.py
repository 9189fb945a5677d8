import numpy as np
from test_inference import FRAME, blob, boundaries, raster_order

from cccd.geometry.opencv import border_pixels
from cccd.settings.junctions import InferenceSettings
from cccd_junctions.decoding import closed_chains, fill_inside
from cccd_junctions.delaunay import build_graph
from cccd_junctions.labelling import label_slice
from cccd_junctions.ordering import order_boundaries
from cccd_training.junctions.labels import inside_shares
from cccd_training.junctions.scoring import score_slice


def curves_of(graph, inside, parts=None):
    masks, origin = fill_inside(graph, inside)
    return closed_chains(masks, origin, np.zeros(1, int), FRAME, parts)


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
