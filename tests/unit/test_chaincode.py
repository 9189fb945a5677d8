import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from test_tracing import blobs, trace

from cccd import chaincode
from cccd.containers import Boundaries, Frame
from cccd.geometry.arrays import concatenate_ragged, successors

FRAME = Frame(np.eye(4), 2, (60, 60, 9))


def boundaries_of(*pictures):
    """Boundaries from pictures: one row of text per i, ``#`` where a boundary pixel is."""
    parts = [np.argwhere([[char == "#" for char in row] for row in picture]) for picture in pictures]
    points, offsets = concatenate_ragged(parts)
    return Boundaries(points.astype(np.int32), offsets, np.arange(len(parts), dtype=np.int32), FRAME)


# Codes ----------------------------------------------------------------------------------------------


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
