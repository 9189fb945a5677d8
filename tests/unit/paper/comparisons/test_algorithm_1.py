import numpy as np
import pytest
import torch
from support.shapes import structure_of

from cccd.containers import Sections
from cccd.contours import trace_contours
from cccd.curves.fitting import fit_splines
from cccd.settings.junctions import BoundarySettings
from cccd.settings.surface import LoftSettings
from cccd.surface.loft import loft_surface
from cccd_junctions.boundary import extract_boundaries
from cccd_junctions.ordering import order_boundaries
from cccd_paper.comparisons.algorithm_1 import (
    OURS,
    PAPER,
    compare_algorithm_1,
    run_algorithm_1,
    section_figures,
)
from cccd_paper.junctions.network import PaperNetwork


@pytest.fixture(scope="module")
def structure():
    """An ellipsoid, 20 pixels wide and 10 slices high."""
    index = np.stack(np.meshgrid(*map(np.arange, (50, 50, 14)), indexing="ij"), axis=-1)
    mask = np.sum(((index - (25, 25, 7)) / (20, 15, 5.2)) ** 2, axis=-1) <= 1
    return structure_of(mask, (1, 1, 3))


@pytest.fixture(scope="module")
def orderer():
    torch.manual_seed(0)
    network = PaperNetwork(channels=4, dropout=0.5)
    return lambda boundaries, *_, **__: order_boundaries(boundaries, network)[0]


@pytest.fixture(scope="module")
def boundaries(structure):
    return extract_boundaries(structure, BoundarySettings())


def test_on_outlines_the_chain_is_nearly_the_traced_mask_and_its_tube_is_near_it(
    structure, boundaries, orderer
):
    chain = run_algorithm_1(boundaries, orderer)
    traced = trace_contours(structure)
    assert chain.curves.slice.tolist() == traced.slice.tolist()
    assert np.abs(chain.curves.polygons.signed_areas) == pytest.approx(
        np.abs(traced.polygons.signed_areas), rel=0.005
    )
    assert chain.mesh.is_closed_manifold
    assert chain.mesh.volume == pytest.approx(3 * structure.mask.sum(), rel=0.1)


def test_a_map_that_does_not_close_has_no_curve_and_one_slice_no_surface(boundaries, orderer):
    keep = np.ones(len(boundaries.points), bool)
    for start in boundaries.offsets[:-2]:
        keep[start] = False  # every slice but the last has a gap
    counts = np.add.reduceat(keep, boundaries.offsets[:-1])
    offsets = np.concatenate([[0], np.cumsum(counts)])
    broken = type(boundaries)(boundaries.points[keep], offsets, boundaries.slice, boundaries.frame)
    chain = run_algorithm_1(broken, orderer)
    assert chain.curves.slice.tolist() == [int(boundaries.slice[-1])]
    assert chain.mesh is None


def test_both_methods_have_a_row_and_a_panel(structure, boundaries, orderer):
    curves = trace_contours(structure)
    splines, surface = fit_splines(curves), loft_surface(Sections(curves), LoftSettings())
    rows = compare_algorithm_1(structure, boundaries, curves, splines, surface, orderer).set_index("method")
    assert rows.index.tolist() == [PAPER, OURS]
    assert (rows["closed"] == rows["slices"]).all()
    assert rows["dice_2d"].between(0.94, 1).all()
    assert rows.loc[PAPER, "share"] > rows.loc[OURS, "share"]
    assert rows["dice_3d"].min() > 0.9
    assert rows.loc[PAPER, "seconds"] > 0
    figure = section_figures(structure, boundaries, surface, orderer)["algorithm_1"]
    assert [sorted(panel.layers) for panel in figure.panels] == [["boundary", "spline"]] * 2
    for panel in figure.panels:
        extent = np.ptp(panel.layers["spline"].reshape(-1, 2), axis=0)
        assert extent == pytest.approx([33, 40], rel=0.15)  # down across the slices, to the right along a row
