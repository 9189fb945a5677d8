import numpy as np

from cccd.containers import Boundaries, Frame
from cccd.geometry.arrays import concatenate_ragged
from cccd_junctions.greedy_chains import isolated_corners, junction_pixels

FRAME = Frame(np.eye(4), 2, (60, 60, 9))


def boundaries_of(*pictures):
    """Boundaries from pictures: one row of text per i, ``#`` where a boundary pixel is."""
    parts = [np.argwhere([[char == "#" for char in row] for row in picture]) for picture in pictures]
    points, offsets = concatenate_ragged(parts)
    return Boundaries(points.astype(np.int32), offsets, np.arange(len(parts), dtype=np.int32), FRAME)


def test_a_clean_ring_has_neither_junctions_nor_isolated_corners():
    ring = boundaries_of([".##.", "#..#", "#..#", ".##."])
    assert not junction_pixels(ring).any()
    assert not isolated_corners(ring).any()


def test_three_strands_meet_in_a_junction_and_slices_do_not_touch():
    cross = ["#...#", ".#.#.", "..#..", "..#..", "..#.."]
    boundaries = boundaries_of(cross, ["#####"])
    junction = junction_pixels(boundaries)
    assert boundaries.points[junction].tolist() == [[2, 2]]
    assert boundaries.offsets[0] <= np.flatnonzero(junction)[0] < boundaries.offsets[1]


def test_figure_4_a_wrong_turn_at_a_staircase_corner_isolates():
    # path y goes straight on at the square corner and takes the corner pixel last: no successor is left
    square = boundaries_of([".###.", "#...#", "#...#", "#...#", ".####"])
    assert square.points[junction_pixels(square)].tolist() == [[3, 4], [4, 3]]
    stuck = isolated_corners(square)
    assert square.points[stuck].tolist() == [[4, 2], [4, 4]]  # and the rest ends in the open
    # without the superfluous pixel the same contour is walked in one go
    clean = boundaries_of([".###.", "#...#", "#...#", "#...#", ".###."])
    assert not isolated_corners(clean).any()


def test_open_lines_and_single_pixels_are_isolated():
    boundaries = boundaries_of(["....", ".##.", "...."], ["#"])
    assert isolated_corners(boundaries).sum() == 2
    empty = boundaries_of([""])
    assert len(isolated_corners(empty)) == len(junction_pixels(empty)) == 0
