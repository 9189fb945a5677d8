from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage
from support.shapes import drawn

from cccd.containers import Frame, Structure
from cccd.errors import InputError
from cccd.settings.junctions import BoundarySettings
from cccd_junctions.boundary import dilation_band, edge_map, extract_boundaries, outline

SETTINGS = BoundarySettings(blur_px=1.0)


def structure_of(axis=2, **arrays):
    """A structure whose stacks (S, I, J) lie along ``axis`` of the source volume."""
    moved = {name: np.moveaxis(stack, 0, axis) for name, stack in arrays.items()}
    return Structure("case", "organ", Frame(np.eye(4), axis, (90, 90, 90)), np.array([5, 7, 9]), **moved)


def pixels(boundaries):
    return {
        (int(k), int(i), int(j))
        for k, points in zip(boundaries.slice, boundaries, strict=True)
        for i, j in points
    }


def test_band_is_the_exclusive_or_with_a_five_by_five_dilation():
    stack = np.random.default_rng(1).random((3, 30, 20)) < 0.03
    expected = ndimage.binary_dilation(stack, np.ones((1, 5, 5), bool)) ^ stack
    assert np.array_equal(dilation_band(stack), expected)


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0.1, 0.9))
def test_outline_is_what_border_following_visits(seed, density):
    stack = np.random.default_rng(seed).random((2, 12, 14)) < density
    found = outline(stack)
    for mask, border in zip(stack, found, strict=True):
        contours, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
        drawn = np.zeros_like(mask)
        for contour in contours:
            drawn[contour[:, 0, 1], contour[:, 0, 0]] = True
        assert np.array_equal(border, drawn)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_mask_boundaries_are_source_indices_on_any_slice_axis(axis):
    mask = np.zeros((4, 20, 20), bool)
    mask[1:3, 0:6, 4:9] = True  # touches the array's face: what lies outside is background
    structure = structure_of(axis, mask=mask)
    boundaries = extract_boundaries(structure, SETTINGS)
    k, i, j = structure.stack_origin
    ring = {(r, c) for r in range(6) for c in range(4, 9) if r in (0, 5) or c in (4, 8)}
    assert pixels(boundaries) == {(k + layer, i + r, j + c) for layer in (1, 2) for r, c in ring}
    assert boundaries.slice.tolist() == [k + 1, k + 2]
    raster = boundaries.points[: boundaries.offsets[1]]
    assert np.array_equal(raster, raster[np.lexsort(raster.T[::-1])])


def test_boundary_stacks_pass_through_and_replace_the_mask():
    boundary = np.random.default_rng(3).random((3, 9, 9)) < 0.2
    structure = structure_of(boundary=boundary, mask=np.ones((3, 9, 9), bool))
    found = extract_boundaries(structure, SETTINGS)
    origin = structure.stack_origin
    assert pixels(found) == {tuple(int(v) for v in index) for index in np.argwhere(boundary) + origin}


def test_ordered_contours_are_drawn_as_closed_pixel_lines():
    square = np.array([[10.0, 10], [10, 14], [14.2, 14], [14.2, 10]])
    found = extract_boundaries(replace(structure_of(), contours=drawn([square], [3])), SETTINGS)
    ring = {(3, i, j) for i in range(10, 15) for j in range(10, 15) if i in (10, 14) or j in (10, 14)}
    assert pixels(found) == ring


def test_image_edges_find_a_blurred_noisy_disc():
    rng = np.random.default_rng(5)
    i, j = np.meshgrid(np.arange(80), np.arange(80), indexing="ij")
    distance = np.hypot(i - 40, j - 38)
    image = np.stack([100 / (1 + np.exp(distance - 22))] * 3) + rng.normal(0, 5, (3, 80, 80))
    rough = np.stack([distance < 20] * 3)
    edges = edge_map(image, rough, BoundarySettings())
    for edge in edges:
        assert np.abs(distance[edge] - 22).max() < 1
        angle = np.arctan2(j - 38, i - 40)[edge]
        assert len(np.unique(np.round(angle / (2 * np.pi) * 60) % 60)) == 60  # all round
    band = dilation_band(rough) | dilation_band(~rough)
    narrow = edge_map(image, rough, BoundarySettings(dilations=1))
    assert not (narrow & ~band).any()


def test_a_flat_image_has_no_edges_and_says_so():
    flat = np.zeros((2, 8, 8))
    with pytest.raises(InputError, match="no slice has a boundary"):
        extract_boundaries(structure_of(image=flat, region=flat > 1), SETTINGS)


def test_an_image_without_a_region_and_a_mask_without_its_image_are_refused():
    with pytest.raises(InputError, match="there is no mask"):
        extract_boundaries(structure_of(image=np.zeros((2, 8, 8))), SETTINGS)
    with pytest.raises(InputError, match="there is no image"):
        extract_boundaries(structure_of(mask=np.ones((2, 8, 8), bool)), BoundarySettings(source="image"))


def test_where_the_image_shows_no_edge_the_region_s_border_stands_in():
    """Half of a disc is as grey as what is around it."""
    i, j = np.indices((1, 80, 80))[1:] - 40
    disc = np.hypot(i, j) < 20
    grey = np.where(disc & (j < 0), 100.0, 0.0) + np.where(j >= 0, 100.0, 0.0)
    rough = np.hypot(i, j) < 22.5
    found = edge_map(grey, rough, SETTINGS)
    border = outline(rough)
    unseen = border & (j > 6)
    assert found[unseen].all()
    assert not found[border & (j < -4)].any()  # there the edge is nearer to the disc
    seen = np.argwhere(found[0] & (j[0] < -4)) - 40
    assert len(seen) > 40
    assert np.abs(np.hypot(*seen.T) - 20).max() <= 1
