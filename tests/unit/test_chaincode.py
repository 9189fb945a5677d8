import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from test_tracing import blobs, trace

from cccd import chaincode
from cccd.geometry.arrays import concatenate_ragged, successors


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
