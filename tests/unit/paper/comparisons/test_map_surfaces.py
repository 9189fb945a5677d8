"""What became of a boundary map: its links sorted, and its surface beside the classical decoder's."""

from dataclasses import replace

import numpy as np
from support import shapes

from cccd.containers import Boundaries, Frame, Sections, Structure
from cccd.contours import trace_contours
from cccd.settings.junctions import BoundarySettings
from cccd.settings.surface import LoftSettings
from cccd.surface.loft import loft_surface
from cccd_junctions.boundary import extract_boundaries
from cccd_junctions.ordering import count_changes
from cccd_paper.comparisons.map_surfaces import (
    FOUND,
    NETWORK,
    best_decoded,
    best_threshold,
    compare_map_surfaces,
    map_figures,
    map_links,
)


def square():
    """A ring of 20 pixels around a square of 6 x 6, as a curve on slice 7."""
    side = [(2, j) for j in range(2, 7)] + [(i, 7) for i in range(2, 7)]
    chain = np.array([*side, *[(9 - i, 9 - j) for i, j in side]], float)
    return shapes.drawn([chain], [7])


def test_links_are_kept_dropped_or_bridged():
    """Two pixels of the ring, one beside a corner, are not in the map, and a spur of three sticks out."""
    curve = square()
    chain = curve.points.astype(int)
    spur = np.array([(3, 8), (3, 9), (3, 10)])
    pixels = np.concatenate([np.delete(chain, [13, 14], axis=0), spur])
    links = map_links(pixels, curve)
    assert len(links["kept"]) == 17
    assert len(links["bridged"]) == 3  # along the two pixels
    # the spur's own, those of its first pixel to the ring, and those that cut across three whole corners
    assert len(links["dropped"]) == 2 + 3 + 3
    bridged = np.unique(links["bridged"].reshape(-1, 2), axis=0)
    assert {tuple(p) for p in chain[[13, 14]].tolist()} <= {tuple(p) for p in bridged.astype(int).tolist()}


def ball():
    """A region whose image shows it, with spurs in its boundary map; the mask is the truth."""
    return shapes.structure_of(shapes.ball((60, 60, 12), (30, 30, 5.5), 18, (1, 1, 3)), (1, 1, 3))


def spurred(structure):
    boundaries = extract_boundaries(structure, BoundarySettings())
    maps = np.zeros_like(structure.mask)
    for k, pixels in zip(boundaries.slice, boundaries, strict=True):
        maps[pixels[:, 0], pixels[:, 1], k] = True
        maps[pixels[:, 0].max() : pixels[:, 0].max() + 5, 30, k] = True
    return replace(structure, boundary=maps, region=structure.mask)


def test_surfaces_are_scored_beside_the_classical_decoder_s():
    structure = spurred(ball())
    whole = extract_boundaries(structure, BoundarySettings())
    contours = trace_contours(structure)
    lofting = LoftSettings()
    surface = loft_surface(Sections(contours), lofting)
    asked = (structure, whole, contours, surface, lofting)
    table = compare_map_surfaces(*asked).set_index("method")
    assert [table.index[0], *table.index[2:]] == [NETWORK, FOUND]
    assert table.index[1].startswith("best classical decoder: ")
    slices = len(contours)
    assert table.loc[NETWORK, ["slices", "decided", "without_curve", "bridged"]].tolist() == [
        slices,
        slices,
        0,
        0,
    ]
    assert table.loc[NETWORK, "dropped"] == count_changes(whole, contours)["dropped"] == 4 * slices
    # the same curves, with a spline and without
    np.testing.assert_allclose(table.loc[NETWORK, "assd_mm"], table.loc[FOUND, "assd_mm"], rtol=0.01)
    assert table["dice_3d"].min() > 0.97
    (figure,) = map_figures(*asked[:3]).values()
    assert len(figure.panels) == 2 * figure.columns == 8
    assert set(figure.panels[0].layers) == {"kept", "dropped", "bridged"}
    assert ", 0 bridged\nDice 1.000" in figure.panels[0].detail


def test_a_slice_that_no_chain_closes_has_no_curve_and_keeps_no_link():
    line = np.array([[3, 3], [3, 4]], np.int32)
    frame = Frame(np.eye(4), 2, (8, 8, 1))
    alone = Boundaries(line, np.array([0, 2]), np.zeros(1, np.int32), frame)
    _, curves = best_decoded(Structure("a", "b", frame, np.zeros(3, int)), alone)
    assert len(curves) == 0
    assert {name: len(links) for name, links in map_links(line, curves).items()} == {
        "dropped": 1,
        "kept": 0,
        "bridged": 0,
    }
    assert not curves.rasterise((0, 0, 0), (1, 8, 8)).any()


def test_the_best_threshold_is_the_seed_s_component_without_a_bridge():
    """A ball and a slab of one grey value, a bridge two pixels wide, and a brighter body around."""
    structure = ball()
    image = np.where(structure.mask, 50.0, 100.0)
    image[:8] = 50
    image[8:13, 29:31] = 50
    rng = np.random.default_rng(0)
    noisy = (image + rng.normal(0, 3, image.shape)).astype(np.float32)
    seeded = replace(structure, image=noisy, provenance={"region": {"seed": ["30,30,5"]}})
    found = np.moveaxis(best_threshold(seeded), 0, 2)
    overlap = 2 * (found & structure.mask).sum() / (found.sum() + structure.mask.sum())
    assert overlap > 0.98
