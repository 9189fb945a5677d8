import numpy as np
import pytest

from cccd_junctions.branches import SHAPE_COLUMNS, connected_nodes, find_branches


def line(start, step, count):
    return np.array(start) + np.arange(count)[:, None] * np.array(step)


def circle(radius, centre=0):
    angle = np.linspace(0, 2 * np.pi, 400)
    return (
        np.unique(np.rint(radius * np.column_stack([np.sin(angle), np.cos(angle)])).astype(int), axis=0)
        + centre
    )


def shape(table, name):
    return table[:, SHAPE_COLUMNS[name]][:, 0]


def found_in(*parts):
    pixels = np.concatenate(parts)
    apart = np.abs(pixels[:, None] - pixels[None]).max(axis=2)
    assert len(np.unique(pixels, axis=0)) == len(pixels)
    near, far = (np.argwhere(np.triu(pair)) for pair in (apart == 1, (apart > 1) & (apart < 12)))
    return pixels, find_branches(pixels, near, far)


@pytest.mark.parametrize("step", [(-1, 0), (-1, 1), (-1, -1)])
def test_a_spur_splits_a_line_into_three_branches_and_leaves_it_one_group(step):
    bar, spur = line((0, 0), (0, 1), 41), line((0, 20), step, 12)[1:]
    found = found_in(bar, spur)[1]
    branch, group = found.branch, found.group
    left, right, side = branch[2], branch[38], branch[41 + 8]
    assert len({left, right, side}) == 3
    assert (branch[:18] == left).all()
    assert (branch[23:41] == right).all()
    assert (branch[44:] == side).all()
    assert group[2] == group[38] != group[41 + 8]


def test_crossing_lines_are_two_groups():
    across = line((-15, 20), (1, 0), 31)
    bar = line((0, 0), (0, 1), 41)
    _, found = found_in(bar, across[across[:, 0] != 0])
    bar, across = found.group[:41], found.group[41:]
    assert bar[0] == bar[-1] != across[0] == across[-1]
    assert len(np.unique(found.branch[[0, 40, 41, -1]])) == 4


@pytest.mark.parametrize(("shift", "one"), [(0, True), (7, False)])
def test_a_group_goes_on_across_a_gap_where_it_points_there(shift, one):
    _, found = found_in(line((0, 0), (0, 1), 20), line((shift, 26), (0, 1), 20))
    assert found.branch[0] != found.branch[-1]
    assert (found.group[0] == found.group[-1]) == one
    # dead ends, of at most two, that are left to each
    assert shape(found.branch_shape, "dead_ends")[0] == shape(found.group_shape, "dead_ends")[0] == 1


def test_a_closed_curve_of_two_pieces_has_no_dead_end_as_a_group():
    ring = circle(20)
    _, found = found_in(ring[np.abs(ring[:, 1]) > 3])
    assert (shape(found.branch_shape, "dead_ends") == 1).all()
    assert (shape(found.group_shape, "dead_ends") == 0).all()


def test_corners_and_curves_do_not_split_a_branch():
    stairs = np.repeat(np.arange(12), 2)
    pixels = np.column_stack([stairs, np.roll(stairs, -1)])[:-1]
    assert len(np.unique(found_in(pixels)[1].branch)) == 1


def test_straight_lines_differ_from_arcs_and_dead_ends_are_counted():
    arc = circle(40)
    arc = arc[(arc > 0).all(axis=1)]
    slanted = np.column_stack([np.arange(40), np.rint(0.37 * np.arange(40)).astype(int) + 100])
    ring = circle(12, (0, 200))
    _, found = found_in(arc, slanted, ring)
    across, dead_ends, size = (
        shape(found.branch_shape, name)[[0, len(arc), -1]] for name in ("spread_across", "dead_ends", "size")
    )
    # a digital straight line keeps within half a pixel of it: 1 / sqrt(12) RMS
    assert np.exp(across[1]) - 0.2 == pytest.approx(np.sqrt(1 / 12), abs=0.06)
    assert np.exp(across[0]) - 0.2 > 2
    assert dead_ends.tolist() == [1, 1, 0]
    assert np.exp(4 * size[2]) == pytest.approx(len(ring))


def test_a_branch_points_outward_at_its_ends_only():
    outward = found_in(line((5, 3), (0, 1), 30), line((9, 3), (0, 1), 30))[1].outward
    assert outward[0] == pytest.approx([0, -1])
    assert outward[29] == pytest.approx([0, 1])
    assert outward[15] == pytest.approx([0, 0])


@pytest.mark.parametrize(
    "pixels", [[(3, 4)], [(0, 0), (0, 1)], [(0, 0), (0, 9)], [(0, 0), (0, 1), (1, 0), (1, 1)]]
)
def test_maps_without_junctions_or_ends_are_no_trouble(pixels):
    _, found = found_in(np.array(pixels))
    assert np.isfinite([found.branch_shape, found.group_shape]).all()
    assert len(np.unique(found.branch)) == (2 if pixels[-1] == (0, 9) else 1)


def test_joined_nodes_are_known_by_their_lowest():
    assert connected_nodes(6, np.array([[4, 2], [5, 4], [0, 1]])).tolist() == [0, 0, 2, 3, 2, 2]
