"""Three ways to ordered contours: what each gives, and what each says to a structure that is not its own."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage
from support import ROOT
from support.refusals import refusal

from cccd import chaincode
from cccd.containers import Frame, Structure
from cccd.contours import take_contours, trace_contours, trace_stack
from cccd.errors import InputError
from cccd.geometry.arrays import concatenate_ragged, successors
from cccd.settings.junctions import BoundarySettings
from cccd_junctions.boundary import extract_boundaries, outline
from cccd_junctions.checkpoint import load_model
from cccd_junctions.ordering import order_contours
from cccd_workflow import contour_ways

FRAME = Frame(np.eye(4), 2, (60, 60, 9))
ORIGIN = np.array([3, 10, 20])


def trace(mask):
    return trace_stack(np.atleast_3d(mask).reshape(-1, *mask.shape[-2:]), ORIGIN, FRAME)


def blobs(seed, shape=(3, 24, 26)):
    """Smooth random regions with several components and holes."""
    rng = np.random.default_rng(seed)
    noise = ndimage.gaussian_filter(rng.normal(size=shape), (0, 1.5, 1.5), mode="constant")
    return noise > noise.std() * rng.uniform(-0.5, 1)


def assert_valid(curves):
    assert curves.polygons.is_simple.all()
    assert chaincode.on_pixel_chain(curves.points, curves.offsets).all()
    area = curves.polygons.signed_areas
    assert np.array_equal(area < 0, curves.hole)
    assert np.all(np.diff(curves.slice) >= 0)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.booleans())
def test_curves_of_any_mask_are_simple_and_fill_back_to_it(seed, dirty):
    mask = np.random.default_rng(seed).random((2, 11, 12)) < 0.6 if dirty else blobs(seed)
    curves = trace(mask)
    assert_valid(curves)
    filled = curves.rasterise(ORIGIN, mask.shape)
    assert not (filled & ~mask).any()
    opened = ndimage.binary_opening(mask, np.ones((1, 2, 2), bool))
    assert not (opened & ~filled).any()  # whatever is two pixels wide is kept
    lost = contour_ways.left_out(mask, ORIGIN, curves)
    assert lost["component_pixels"] + lost["spur_pixels"] == np.count_nonzero(mask & ~filled)
    area = 0.0
    for picture in mask.astype(np.uint8):
        contours, hierarchy = cv2.findContours(picture, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
        signs = [1 if link[3] < 0 else -1 for link in (hierarchy[0] if len(contours) else ())]
        area += sum(sign * cv2.contourArea(c) for sign, c in zip(signs, contours, strict=True))
    assert curves.polygons.signed_areas.sum() == area


def test_a_mask_without_thin_parts_is_traced_along_its_outline():
    mask = ndimage.binary_opening(blobs(4, (2, 50, 50)), np.ones((1, 3, 3), bool))
    curves = trace(mask)
    assert np.array_equal(curves.rasterise(ORIGIN, mask.shape), mask)
    k = np.repeat(curves.slice, np.diff(curves.offsets)) - ORIGIN[0]
    visited = np.zeros_like(mask)
    visited[k, *(curves.points - ORIGIN[1:]).astype(int).T] = True
    assert np.array_equal(visited, outline(mask))


def test_pinches_spurs_and_islands():
    mask = np.zeros((12, 30), bool)
    mask[1:6, 1:6] = mask[1:6, 8:13] = True
    mask[3, 6:8] = True  # a bridge one pixel wide
    mask[3, 13:17] = True  # a spur
    mask[8, 1:5] = True  # a line
    mask[8, 8] = True  # a single pixel
    mask[1:11, 18:29] = True
    mask[3:9, 20:27] = False  # a hole ...
    mask[5:7, 22:25] = True  # ... with tissue that hangs into it
    mask[3:5, 23] = True
    curves = trace(mask)
    assert_valid(curves)
    areas = curves.polygons.signed_areas
    # a loop reaches to the first pixel of what is attached to it: a triangle of area 1
    assert sorted(areas) == [-(7 * 8 - 4 / 2 - 1), 2 + 1, 16 + 1, 16 + 2, 9 * 10]
    assert contour_ways.left_out(mask[None], ORIGIN, curves) == {
        "components": 2,
        "component_pixels": 5,
        "spur_pixels": 3,
        "parts": 2,
        "part_voxels": 5,
        "voxels": np.count_nonzero(mask),
    }
    # what is a single pixel on one slice only is a part of what it lies on
    tower = np.stack([np.pad(np.ones((4, 4), bool), 3), np.eye(10, dtype=bool) & (np.arange(10) == 4)])
    lost = contour_ways.left_out(tower, ORIGIN, trace(tower))
    assert (lost["components"], lost["parts"]) == (1, 0)


def test_structures_are_traced_in_source_indices_and_nothing_gives_nothing():
    mask = np.zeros((6, 7, 8), bool)
    mask[1:4, 2:6, 3:7] = True
    structure = Structure("c", "o", Frame(np.eye(4), 1, (30, 30, 30)), np.array([4, 5, 6]), mask=mask)
    curves = trace_contours(structure)
    assert curves.slice.tolist() == [7, 8, 9, 10]
    assert curves.points.min(axis=0).tolist() == [5, 9]
    assert curves.points.max(axis=0).tolist() == [7, 12]
    nothing = trace(np.zeros((2, 5, 5), bool))
    assert len(nothing) == 0
    assert nothing.points.shape == (0, 2)
    assert chaincode.chain_codes(nothing.points, nothing.offsets).shape == (0,)


def test_numbering_of_figure_1():
    ring = np.array([(2, 3), (1, 3), (1, 2), (1, 1), (2, 1), (3, 1), (3, 2), (3, 3)])
    codes = chaincode.chain_codes(ring, np.array([0, 8]))
    assert codes.tolist() == [2, 4, 4, 6, 6, 0, 0, 2]
    assert np.array_equal(chaincode.DIRECTIONS[0], (0, 1))
    assert np.array_equal(chaincode.DIRECTIONS + np.roll(chaincode.DIRECTIONS, 4, axis=0), np.zeros((8, 2)))


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_codes_of_traced_curves_lead_from_each_point_to_the_next(seed):
    curves = trace(blobs(seed))
    codes = chaincode.chain_codes(curves.points, curves.offsets)
    assert codes.dtype == np.uint8
    following = curves.points + chaincode.DIRECTIONS[codes]
    assert np.array_equal(following, curves.points[successors(curves.offsets)])


def test_a_link_across_a_gap_has_no_code():
    points, offsets = np.array([(0, 0), (0, 1), (1, 0), (5, 5), (5, 7), (6, 6)]), np.array([0, 3, 6])
    with pytest.raises(ValueError, match="curve 1 has a link"):
        chaincode.chain_codes(points, offsets)
    assert chaincode.on_pixel_chain(points, offsets).tolist() == [True, False]
    assert not chaincode.on_pixel_chain(points[:3] + 0.5, offsets[:2]).any()


def test_a_chain_with_a_gap_keeps_one_isolated_corner_and_a_whole_one_none():
    square = np.array([(0, 0), (0, 1), (0, 2), (1, 2), (2, 2), (2, 1), (2, 0), (1, 0)], float)
    points, offsets = concatenate_ragged([square, np.delete(square, 5, axis=0)])
    assert np.flatnonzero(chaincode.broken_links(points, offsets)).tolist() == [8 + 4]


MODEL = ROOT / "workflow" / "models" / "junctions.pt"


def structure_of(stack=None, contours=None) -> Structure:
    """A structure whose slices (S, I, J) lie along the last axis, off the corner of its scan."""
    mask = None if stack is None else np.moveaxis(stack, 0, 2)
    return Structure(
        "a", "b", Frame(np.eye(4), 2, (99, 99, 99)), np.array([5, 6, 7]), mask=mask, contours=contours
    )


def discs(*radii) -> np.ndarray:
    i, j = np.indices((61, 61)) - 30
    return np.stack([i**2 + j**2 <= radius**2 for radius in radii])


@pytest.fixture(scope="module")
def model():
    return load_model(MODEL)


def test_a_mask_is_traced_and_an_empty_one_refused():
    assert contour_ways.trace_contours(structure_of(discs(9)))[1]["method"] == "traced mask"
    with pytest.raises(InputError, match="no slice has a closed boundary"):
        trace_contours(structure_of(np.zeros((2, 9, 9), bool)))


def test_contours_are_taken_as_they_are():
    drawn = trace_contours(structure_of(discs(9, 12)))
    curves, report = contour_ways.take_contours(structure_of(contours=drawn))
    assert curves is drawn
    assert report == {"method": "contours as given"}


def test_the_network_orders_an_outline_as_it_is_traced(model):
    structure = structure_of(discs(12, 20, 16))
    exact = trace_contours(structure)
    curves, report = order_contours(structure, extract_boundaries(structure, BoundarySettings()), model)
    np.testing.assert_array_equal(curves.offsets, exact.offsets)
    np.testing.assert_array_equal(curves.points, exact.points)
    np.testing.assert_array_equal(curves.slice, exact.slice)
    assert report["method"] == "GNN"
    assert report["pixels"] == len(exact.points)


def test_a_structure_on_the_wrong_way_is_told_so_in_one_line(model):
    masked = structure_of(discs(9, 12))
    drawn = structure_of(contours=trace_contours(masked))
    boundaries = extract_boundaries(masked, BoundarySettings())
    for line, problem in [
        (refusal(trace_contours, drawn), "there is no mask to trace"),
        (refusal(take_contours, masked), "there are no drawn contours"),
        (refusal(order_contours, drawn, boundaries, model), "its contours are drawn, and need no ordering"),
    ]:
        cure = "its file has changed since the run was planned: run snakemake again"
        assert line == f"a/b: {problem}; {cure}"
