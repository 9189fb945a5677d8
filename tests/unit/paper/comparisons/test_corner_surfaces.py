"""Surfaces from the corners of each k: what they keep, what they cost, and the slab that is taken."""

import numpy as np
import pytest

from cccd.containers import Frame, Structure
from cccd.contours import trace_contours
from cccd.settings.junctions import BoundarySettings
from cccd.settings.surface import LoftSettings
from cccd_junctions.boundary import extract_boundaries
from cccd_paper.comparisons.corner_surfaces import compare_corner_surfaces
from cccd_paper.comparisons.paper_k import AUTOMATIC
from cccd_paper.comparisons.samples import between, middle_slab
from cccd_paper.settings import CornerSurfaceSettings


def scanned(axis=2, origin=(0, 0, 0)):
    """An ellipsoid with 2 mm slices along one axis, its boundary pixels and its curves."""
    size = np.array([44, 44, 44])
    size[axis] = 24
    spacing = np.ones(3)
    spacing[axis] = 2
    index = np.stack(np.meshgrid(*map(np.arange, size), indexing="ij"), axis=-1)
    mask = np.sum(((index - (size - 1) / 2) * spacing / (18, 16, 19)) ** 2, axis=-1) <= 1
    affine = np.diag([*spacing, 1.0])
    affine[:3, 3] = (7, -5, 3)
    shape = tuple(int(n) for n in size + np.array(origin) + 4)
    structure = Structure("a", "b", Frame(affine, axis, shape), np.array(origin), mask=mask)
    return structure, extract_boundaries(structure, BoundarySettings()), trace_contours(structure)


@pytest.mark.parametrize(("axis", "origin"), [(2, (0, 0, 0)), (0, (3, 5, 7))])
def test_a_slab_lies_where_it_lay(axis, origin):
    structure, boundaries, curves = scanned(axis, origin)
    slab, cut, slices = middle_slab(structure, curves, 6)
    pixels = between(boundaries, slices, slab.frame)
    assert np.unique(cut.slice).tolist() == np.unique(pixels.slice).tolist() == list(range(6))
    whole = curves.frame.to_world(curves.points, np.repeat(curves.slice, np.diff(curves.offsets)))
    part = cut.frame.to_world(cut.points, np.repeat(cut.slice, np.diff(cut.offsets)))
    assert set(map(tuple, part.round(6))) <= set(map(tuple, whole.round(6)))
    again = trace_contours(slab)
    assert np.array_equal(again.points, cut.points)
    assert np.array_equal(again.slice, cut.slice)


def test_what_fits_is_taken_whole():
    structure, boundaries, curves = scanned()
    whole, all_curves, slices = middle_slab(structure, curves, 99)
    assert whole is structure
    assert all_curves is curves
    np.testing.assert_array_equal(between(boundaries, slices, whole.frame).points, boundaries.points)


def test_a_row_per_k_with_its_cost_and_its_agreement():
    parts, ks = scanned(), (3, 20)
    table = compare_corner_surfaces(*parts, CornerSurfaceSettings(most_slices=5), LoftSettings(), ks=ks)
    assert table["k"].tolist() == ["3", "20", AUTOMATIC]
    assert (table["slices"] == 5).all()
    corners = table.iloc[:2]
    assert corners["control_points"].is_monotonic_decreasing
    assert corners["dice_2d"].is_monotonic_decreasing
    assert table.loc[[0, 2], "dice_3d"].min() > 0.97
    kept = 8 * table["control_points"] + 4 * 5  # points, and the number of pixels of each slice's one curve
    np.testing.assert_allclose(table["stack_bytes"], 200 * kept / 5)
    np.testing.assert_allclose(table["seconds"], table[["order_s", "curve_s", "surface_s"]].sum(axis=1))


def test_without_a_mask_there_is_no_row():
    structure, boundaries, curves = scanned()
    structure.mask = None
    rows = compare_corner_surfaces(structure, boundaries, curves, CornerSurfaceSettings(), LoftSettings())
    assert rows.empty
