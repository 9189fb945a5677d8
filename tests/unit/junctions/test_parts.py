import numpy as np
import pytest
from test_inference import FRAME, blob, boundaries, raster_order

from cccd.geometry.opencv import border_pixels
from cccd.settings.junctions import InferenceSettings
from cccd_junctions.decoding import closed_chains, fill_inside
from cccd_junctions.delaunay import build_graph
from cccd_junctions.energy import Energy, least_energy
from cccd_junctions.labelling import label_slice
from cccd_junctions.ordering import order_boundaries
from cccd_junctions.parts import limit_parts
from cccd_training.junctions.labels import inside_shares
from cccd_training.junctions.scoring import score_slice


def curves_of(graph, inside, parts=None):
    masks, origin = fill_inside(graph, inside)
    return closed_chains(masks, origin, np.zeros(1, int), FRAME, parts)


def cut_curves(graph, logits, parts=None):
    """Curves of the cut alone, whose pieces are limited."""
    return curves_of(graph, label_slice(graph, logits, parts, rerank=False).inside, parts)


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


def test_two_pieces_are_joined_where_that_costs_less_than_leaving_one_out():
    mask, chain, seen = dumbbell()
    graph = build_graph(raster_order(seen))
    logits = logits_of(graph, mask, (40, 69))
    assert len(cut_curves(graph, logits)) == 2
    joined = cut_curves(graph, logits, 1)
    assert len(joined) == 1
    assert score_slice(list(joined), [chain]).dice > 0.9
    assert len(cut_curves(graph, logits, 2)) == 2


def test_a_piece_that_is_hardly_there_is_left_out_rather_than_joined():
    mask, _, seen = dumbbell()
    graph = build_graph(raster_order(seen))
    within, link = logits_of(graph, mask, (40, 69), doubt=-9.0)
    right = graph.points[graph.triangles].mean(axis=1)[:, 1] > 69
    within[right & (within > 0)] = 0.02
    (curve,) = cut_curves(graph, (within, link), 1)
    assert curve[:, 1].max() < 45


def test_a_hole_is_filled_where_a_part_is_wanted_and_stays_where_none_is():
    chains = border_pixels(blob(hole=True))
    spur = chains[0][0] + np.column_stack([-np.arange(1, 9), np.zeros(8, int)])  # no outline as it is
    graph = build_graph(raster_order(np.vstack([*chains, spur])))
    inside = inside_shares(graph, chains) > 0.5
    logits = np.where(inside, 4.0, -4.0), np.zeros(len(graph.links))
    assert len(cut_curves(graph, logits)) == 2
    (curve,) = cut_curves(graph, logits, 1)
    assert score_slice([curve], chains[:1]).correct


@pytest.mark.parametrize("parts", [1, 2])
def test_whatever_the_energy_there_are_no_more_curves_than_parts(parts):
    rng = np.random.default_rng(parts)
    for _ in range(4):
        graph = build_graph(np.unique(rng.integers(0, 30, (70, 2)), axis=0))
        energy = Energy(rng.normal(0, 3, len(graph.triangles)), rng.exponential(0.5, len(graph.links)))
        least = least_energy(graph, energy)
        limited = limit_parts(graph, energy, least, parts)
        assert not (limited & graph.outer).any()
        curves = curves_of(graph, limited, parts)
        assert len(curves) <= parts
        assert not curves.hole.any()
        # what was the least before costs no more than what has fewer pieces
        nothing = np.zeros(len(least))
        costs = [
            energy.difference(y.astype(float), nothing, graph.link_triangles.T) for y in (least, limited)
        ]
        assert costs[0] <= costs[1] + 1e-9


def test_an_outline_of_several_parts_is_held_to_fewer_as_well():
    mask, _, _ = dumbbell()
    mask[:, 40:70] = 0
    maps = boundaries([raster_order(np.vstack(border_pixels(mask)))])
    found = [order_boundaries(maps, None, settings=InferenceSettings(parts=parts))[0] for parts in (None, 1)]
    assert [len(curves) for curves in found] == [2, 1]
