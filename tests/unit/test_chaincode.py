import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from cccd import chaincode
from cccd.boundary import outline
from cccd.containers import Boundaries, Frame, Structure, concatenate_ragged
from cccd.metrics import rasterise

FRAME = Frame(np.eye(4), 2, (60, 60, 9))
ORIGIN = np.array([3, 10, 20])


def trace(mask):
    return chaincode.trace_stack(np.atleast_3d(mask).reshape(-1, *mask.shape[-2:]), ORIGIN, FRAME)


def boundaries_of(*pictures):
    """Boundaries from pictures: one row of text per i, ``#`` where a boundary pixel is."""
    parts = [np.argwhere([[char == "#" for char in row] for row in picture]) for picture in pictures]
    points, offsets = concatenate_ragged(parts)
    return Boundaries(points.astype(np.int32), offsets, np.arange(len(parts), dtype=np.int32), FRAME)


def blobs(seed, shape=(3, 24, 26)):
    """Smooth random regions with several components and holes."""
    rng = np.random.default_rng(seed)
    noise = ndimage.gaussian_filter(rng.normal(size=shape), (0, 1.5, 1.5), mode="constant")
    return noise > noise.std() * rng.uniform(-0.5, 1)


# Codes ----------------------------------------------------------------------------------------------


def test_numbering_of_figure_1():
    ring = np.array([(2, 3), (1, 3), (1, 2), (1, 1), (2, 1), (3, 1), (3, 2), (3, 3)])
    codes = chaincode.chain_codes(ring, np.array([0, 8]))
    assert codes.tolist() == [2, 4, 4, 6, 6, 0, 0, 2]
    assert np.array_equal(chaincode.DIRECTIONS[0], (0, 1))
    assert np.array_equal(chaincode.DIRECTIONS + np.roll(chaincode.DIRECTIONS, 4, axis=0), np.zeros((8, 2)))


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_codes_of_traced_curves_decode_to_the_same_points(seed):
    curves = trace(blobs(seed))
    codes = chaincode.chain_codes(curves.points, curves.offsets)
    assert codes.dtype == np.uint8
    starts = curves.points[curves.offsets[:-1]]
    assert np.array_equal(chaincode.decode(starts, codes, curves.offsets), curves.points)
    # a closed chain's steps cancel
    steps = np.add.reduceat(chaincode.DIRECTIONS[codes], curves.offsets[:-1], axis=0)
    assert not steps.any()


def test_a_link_across_a_gap_has_no_code():
    points, offsets = np.array([(0, 0), (0, 1), (1, 0), (5, 5), (5, 7), (6, 6)]), np.array([0, 3, 6])
    with pytest.raises(ValueError, match="curve 1 has a link"):
        chaincode.chain_codes(points, offsets)
    assert chaincode.on_pixel_chain(points, offsets).tolist() == [True, False]
    assert not chaincode.on_pixel_chain(points[:3] + 0.5, offsets[:2]).any()


# Ragged helpers -------------------------------------------------------------------------------------


def test_areas_perimeters_and_neighbours_of_ragged_polygons():
    square = np.array([(0, 0), (0, 4), (4, 4), (4, 0)], float)
    points, offsets = concatenate_ragged([square, square[::-1] / 2 + 1e6, square[:0], square[:3]])
    turn = np.sign(chaincode.signed_areas(points[:4], offsets[:2]))[0]
    assert (turn * chaincode.signed_areas(points, offsets)).tolist() == [16, -4, 0, 8]
    assert chaincode.perimeters(points, offsets) == pytest.approx([16, 8, 0, 8 + np.sqrt(32)])
    following, preceding = chaincode.successors(offsets), chaincode.predecessors(offsets)
    assert following.tolist() == [1, 2, 3, 0, 5, 6, 7, 4, 9, 10, 8]
    assert np.array_equal(preceding[following], np.arange(11))


def test_outer_curves_are_counter_clockwise_in_i_j():
    positive = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], float)  # from +i to +j
    assert chaincode.signed_areas(positive, np.array([0, 4])).tolist() == [1]


def test_simplicity_of_polygons():
    square = [(0, 0), (0, 4), (4, 4), (4, 0)]
    bow = [(0, 0), (4, 4), (0, 4), (4, 0)]
    pinched = [(0, 0), (2, 2), (4, 0), (4, 4), (2, 2), (0, 4)]
    repeated = [(0, 0), (0, 4), (0, 4), (4, 4)]
    spur = [(0, 0), (0, 4), (0, 8), (0, 4), (4, 4)]
    parts = [np.array(part, float) for part in (square, bow, pinched, repeated, spur, square[:2])]
    assert chaincode.is_simple(*concatenate_ragged(parts)).tolist() == [True] + [False] * 5


def test_resampling_is_even_and_keeps_a_circle():
    angle = np.sort(np.random.default_rng(0).random(2000)) * 2 * np.pi
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    square = np.array([(0, 0), (0, 4), (4, 4), (4, 0)], float)
    points, offsets = chaincode.resample(*concatenate_ragged([square, circle]), np.array([16, 50]))
    assert np.array_equal(points[:5], [(0, 0), (0, 1), (0, 2), (0, 3), (0, 4)])
    step = np.linalg.norm(points[16:][chaincode.successors(np.array([0, 50]))] - points[16:], axis=1)
    assert step == pytest.approx(2 * np.sin(np.pi / 50), rel=1e-3)
    assert np.array_equal(points[16], circle[0])
    assert offsets.tolist() == [0, 16, 66]


# Junctions and isolated corners ---------------------------------------------------------------------


def test_a_clean_ring_has_neither_junctions_nor_isolated_corners():
    ring = boundaries_of([".##.", "#..#", "#..#", ".##."])
    assert not chaincode.junction_pixels(ring).any()
    assert not chaincode.isolated_corners(ring).any()


def test_three_strands_meet_in_a_junction_and_slices_do_not_touch():
    cross = ["#...#", ".#.#.", "..#..", "..#..", "..#.."]
    boundaries = boundaries_of(cross, ["#####"])
    junction = chaincode.junction_pixels(boundaries)
    assert boundaries.points[junction].tolist() == [[2, 2]]
    assert boundaries.offsets[0] <= np.flatnonzero(junction)[0] < boundaries.offsets[1]


def test_figure_4_a_wrong_turn_at_a_staircase_corner_isolates():
    # path y goes straight on at the square corner and takes the corner pixel last: no successor is left
    square = boundaries_of([".###.", "#...#", "#...#", "#...#", ".####"])
    assert square.points[chaincode.junction_pixels(square)].tolist() == [[3, 4], [4, 3]]
    stuck = chaincode.isolated_corners(square)
    assert square.points[stuck].tolist() == [[4, 2], [4, 4]]  # and the rest ends in the open
    # without the superfluous pixel the same contour is walked in one go
    clean = boundaries_of([".###.", "#...#", "#...#", "#...#", ".###."])
    assert not chaincode.isolated_corners(clean).any()


def test_a_chain_with_a_gap_keeps_one_isolated_corner_and_a_whole_one_none():
    square = np.array([(0, 0), (0, 1), (0, 2), (1, 2), (2, 2), (2, 1), (2, 0), (1, 0)], float)
    points, offsets = concatenate_ragged([square, np.delete(square, 5, axis=0)])
    assert np.flatnonzero(chaincode.broken_links(points, offsets)).tolist() == [8 + 4]


def test_open_lines_and_single_pixels_are_isolated():
    boundaries = boundaries_of(["....", ".##.", "...."], ["#"])
    assert chaincode.isolated_corners(boundaries).sum() == 2
    empty = boundaries_of([""])
    assert len(chaincode.isolated_corners(empty)) == len(chaincode.junction_pixels(empty)) == 0


# Exact curves of a mask -----------------------------------------------------------------------------


def assert_valid(curves):
    assert chaincode.is_simple(curves.points, curves.offsets).all()
    assert chaincode.on_pixel_chain(curves.points, curves.offsets).all()
    area = chaincode.signed_areas(curves.points, curves.offsets)
    assert np.array_equal(area < 0, curves.hole)
    assert np.all(np.diff(curves.slice) >= 0)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.booleans())
def test_curves_of_any_mask_are_simple_and_fill_back_to_it(seed, dirty):
    mask = np.random.default_rng(seed).random((2, 11, 12)) < 0.6 if dirty else blobs(seed)
    curves = trace(mask)
    assert_valid(curves)
    filled = rasterise(curves, ORIGIN, mask.shape)
    assert not (filled & ~mask).any()
    opened = ndimage.binary_opening(mask, np.ones((1, 2, 2), bool))
    assert not (opened & ~filled).any()  # whatever is two pixels wide is kept
    lost = chaincode.left_out(mask, ORIGIN, curves)
    assert lost["component_pixels"] + lost["spur_pixels"] == np.count_nonzero(mask & ~filled)
    area = 0.0
    for picture in mask.astype(np.uint8):
        contours, hierarchy = cv2.findContours(picture, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
        signs = [1 if link[3] < 0 else -1 for link in (hierarchy[0] if len(contours) else ())]
        area += sum(sign * cv2.contourArea(c) for sign, c in zip(signs, contours, strict=True))
    assert chaincode.signed_areas(curves.points, curves.offsets).sum() == area


def test_a_mask_without_thin_parts_is_traced_along_its_outline():
    mask = ndimage.binary_opening(blobs(4, (2, 50, 50)), np.ones((1, 3, 3), bool))
    curves = trace(mask)
    assert np.array_equal(rasterise(curves, ORIGIN, mask.shape), mask)
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
    areas = chaincode.signed_areas(curves.points, curves.offsets)
    # a loop reaches to the first pixel of what is attached to it: a triangle of area 1
    assert sorted(areas) == [-(7 * 8 - 4 / 2 - 1), 2 + 1, 16 + 1, 16 + 2, 9 * 10]
    assert chaincode.left_out(mask[None], ORIGIN, curves) == {
        "components": 2,
        "component_pixels": 5,
        "spur_pixels": 3,
    }


def test_structures_are_traced_in_source_indices_and_nothing_gives_nothing():
    mask = np.zeros((6, 7, 8), bool)
    mask[1:4, 2:6, 3:7] = True
    structure = Structure("c", "o", Frame(np.eye(4), 1, (30, 30, 30)), np.array([4, 5, 6]), mask=mask)
    curves = chaincode.trace_mask(structure)
    assert curves.slice.tolist() == [7, 8, 9, 10]
    assert curves.points.min(axis=0).tolist() == [5, 9]
    assert curves.points.max(axis=0).tolist() == [7, 12]
    nothing = trace(np.zeros((2, 5, 5), bool))
    assert len(nothing) == 0
    assert nothing.points.shape == (0, 2)
    assert chaincode.chain_codes(nothing.points, nothing.offsets).shape == (0,)
