import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import interp1d
from scipy.spatial import cKDTree
from support.shapes import lofted

from cccd.bands import Slices
from cccd.surface.moving_branches import SliceParts, follow_branches, move_branches

PIXEL, GAP = np.ones(2), 5.0


def line(angle, length=60.0, middle=(40.0, 40.0, 45.0)):
    """Points 0.1 mm apart on a line that leans by ``angle`` degrees from the slices' axis."""
    lean = np.radians(angle)
    way = np.array([0.8 * np.sin(lean), 0.6 * np.sin(lean), np.cos(lean)])
    return np.array(middle) + np.arange(-length / 2, length / 2, 0.1)[:, None] * way


def away(points, spacing, size=(80, 80, 90)):
    """Distance in mm of every voxel of a scan of ``size`` mm to a line's points."""
    shape = (np.array(size) / spacing).astype(int)
    return cKDTree(points).query(np.moveaxis(np.indices(shape), 0, -1) * spacing)[0]


def section(centre, half_width=2.0, lean=(0.0, 0.0), size=40):
    """Distances to the section of a round branch, about."""
    offset = np.moveaxis(np.indices((size, size)), 0, -1) - np.array(centre)
    steep = np.linalg.norm(lean)
    along = offset @ np.array(lean) / max(steep, 1e-9)
    inner = np.sum(offset**2, axis=-1) - along**2 + along**2 / (1 + steep**2)
    return np.float32(np.sqrt(inner) - half_width)


def stack(*planes, parts=4):
    """Heights, slices interpolated as they lie, and the slices."""
    z, between = np.arange((len(planes) - 1) * parts + 1) / parts, np.array(planes)
    values = interp1d(np.arange(len(planes)), between, axis=0)(z).astype(np.float32)
    return GAP * z, values, Slices(GAP * np.arange(len(planes)), between, PIXEL)


@pytest.mark.parametrize(
    ("radius", "angle", "spacing"),
    [
        (1.5, 45, (0.75, 0.75, 5)),
        (1.5, 60, (0.75, 0.75, 5)),
        (1.5, 70, (0.75, 0.75, 5)),
        (1.0, 60, (1, 1, 2)),
        (1.0, 60, (1, 1, 3)),
    ],
)
def test_a_vessel_that_runs_aslant_is_one_tube_of_its_radius(radius, angle, spacing):
    points = line(angle)
    mesh = lofted(away(points, spacing) < radius, spacing).mesh
    assert mesh.count_bodies() == 1
    assert mesh.is_closed_manifold
    wall = np.ptp(points[:, 2]) / 2 - GAP > np.abs(mesh.vertices[:, 2] - 45)  # its ends lie between slices
    error = np.abs(cKDTree(points).query(mesh.vertices[wall])[0] - radius)
    assert error.mean() < spacing[0] / 5


def test_a_thin_coil_is_one_tube_though_its_sections_turn_from_slice_to_slice():
    angle = np.arange(0, 3 * np.pi, 0.01)
    points = np.column_stack(
        [40 + 16 * np.cos(angle), 40 + 16 * np.sin(angle), 10 + 45 * angle / (2 * np.pi)]
    )
    mesh = lofted(away(points, (0.75, 0.75, 5)) < 1.6, (0.75, 0.75, 5)).mesh
    assert mesh.count_bodies() == 1
    assert np.mean(np.abs(cKDTree(points).query(mesh.vertices)[0] - 1.6)) < 0.2


def test_a_thin_tunnel_that_runs_aslant_through_a_block_is_open_from_end_to_end():
    spacing = np.array([0.75, 0.75, 5])
    inside = np.zeros((90, 90, 14), bool)
    inside[8:-8, 8:-8, 3:-3] = True
    tunnel = line(50, length=120, middle=(33.5, 33.5, 34.0))
    inside &= away(tunnel, spacing, size=inside.shape * spacing + 0.1) > 1.2
    surface = lofted(inside, spacing)
    assert surface.mesh.genus == 1


def test_a_branch_that_leaves_its_trunk_aslant_hangs_on_it():
    spacing = (0.75, 0.75, 5)
    trunk = line(0, length=80, middle=(25, 30, 45))
    branch = line(65, length=70, middle=(25, 30, 25))
    branch = branch[branch[:, 2] > 25]
    inside = (away(trunk, spacing) < 7) | (away(branch, spacing) < 1.7)
    assert lofted(inside, spacing).mesh.count_bodies() == 1


@given(st.floats(0, 2.5), st.floats(0, np.pi), st.floats(3.5, 5.0))
def test_a_section_tells_how_its_branch_leans(steep, direction, half_width):
    lean = steep * np.array([np.cos(direction), np.sin(direction)])
    sections = SliceParts.of(section((20, 20), half_width, lean), PIXEL)
    np.testing.assert_allclose(sections.centres, [[20, 20]], atol=1e-6)
    assert sections.half_widths[0] == pytest.approx(half_width, abs=0.35)  # half a pixel at most
    found = sections.leans[0]
    assert np.hypot(1, np.linalg.norm(found)) == pytest.approx(np.hypot(1, steep), rel=0.12)
    if steep > 0.8:  # its direction to 8 degrees, or 14 where it leans little (10 measured)
        assert abs(found @ lean) > (0.99 if steep > 1 else 0.97) * np.linalg.norm(found) * steep


def test_slices_stay_and_so_does_what_overlaps_itself_stands_upright_or_lies_where_it_does_not_lean():
    spots = section((12, 20)), section((26, 20))  # upright both: no branch
    across = section((12, 20), lean=(0, 2)), section((24, 20), lean=(0, 2))  # leans the other way
    for below, above in (
        (section((15, 20)), section((16, 20))),
        (section((15, 20), 2), section((15, 20), 5)),
        spots,
        across,
        (section((8, 20), lean=(2, 0)), section((32, 20), lean=(2, 0))),  # too far
    ):
        z, values, slices = stack(below, above)
        assert np.array_equal(move_branches(z, values, slices), values)
    z, values, slices = stack(section((12, 20), lean=(2, 0)), section((22, 20), lean=(2, 0)))
    moved = move_branches(z, values, slices)
    assert np.array_equal(moved[[0, -1]], values[[0, -1]])
    assert values[2, 17, 20] > 0 > moved[2, 17, 20]


def test_ways_are_the_same_upside_down_and_mirrored():
    slices = [section((10 + 7 * n, 12 + 2 * n), lean=(1.4, 0.4)) for n in range(3)]
    up = follow_branches([SliceParts.of(s, PIXEL, GAP * n) for n, s in enumerate(slices)], PIXEL)
    down = follow_branches([SliceParts.of(s, PIXEL, GAP * n) for n, s in enumerate(slices[::-1])], PIXEL)
    assert [len(ways) for ways in up] == [len(ways) for ways in down] == [1, 1]
    for one, other in zip(up, down[::-1], strict=True):
        np.testing.assert_allclose(one[0].shift, -other[0].shift)
        assert one[0].share == pytest.approx(other[0].share)
