"""Organs with shared walls: nothing twice, nothing left out, each closed, smooth lines where three meet."""

from pathlib import Path

import numpy as np
import pytest
from manifold3d import Manifold, Mesh64
from nibabel.loadsave import load

from cccd.containers import Frame, Structure
from cccd.contours import trace_contours
from cccd.geometry.mesh import Mesh
from cccd.settings.surface import LoftSettings
from cccd.solids.shared_walls import Organ, share_walls
from cccd.surface import loft_before_walls

REAL = Path(__file__).parents[4] / "shared" / "data" / "dicom_totalseg_liver20" / "labels.nii.gz"
CENTRE = np.array([15.6, 15.3, 15.8])
RADIUS = 11.0


def ball(shape=(32, 32, 32)):
    i, j, k = np.indices(shape) - CENTRE.reshape(3, 1, 1, 1)
    return i, j, k, np.hypot(np.hypot(i, j), k)


def half_balls():
    i, _, _, r = ball()
    return np.where(r < RADIUS, np.where(i < 0, 1, 2), 0)


def sectors():
    i, j, _, r = ball()
    third = np.floor((np.arctan2(j, i) + np.pi) / (2 * np.pi / 3)).astype(int).clip(0, 2)
    return np.where(r < RADIUS, 1 + third, 0)


def nested():
    r = ball()[3]
    return np.where(r < 5.5, 2, np.where(r < RADIUS, 1, 0))


def shell():
    """A shell of two voxels around a core: a cortex."""
    r = ball()[3]
    return np.where(r < RADIUS - 2, 2, np.where(r < RADIUS, 1, 0))


def organs_of(labels, affine=None, axis=2):
    frame = Frame(np.eye(4) if affine is None else affine, axis, labels.shape)
    found = {}
    for label in range(1, int(labels.max()) + 1):
        mask = labels == label
        structure = Structure("case", f"organ{label}", frame, np.zeros(3, np.int64), mask=mask)
        sections = structure.sections(trace_contours(structure)[0])
        surface = loft_before_walls(sections, LoftSettings())
        found[label] = Organ(f"organ{label}", structure, surface.mesh)
    return found


@pytest.fixture(scope="module", params=[half_balls, sectors, nested, shell], ids=lambda make: make.__name__)
def joined(request):
    organs = organs_of(request.param())
    return organs, share_walls(organs)


def solid(mesh):
    return Manifold(Mesh64(mesh.vertices, mesh.faces.astype(np.uint64)))


def test_organs_are_closed_and_hold_the_volume_of_their_voxels(joined):
    organs, shared = joined
    assert shared.pinched == shared.passing == 0
    for label, organ in organs.items():
        mesh = shared.surface.mesh_of(label)
        assert mesh.is_closed_manifold
        assert mesh.volume == pytest.approx(np.count_nonzero(organ.structure.mask), rel=0.001)


def test_nothing_belongs_to_two_organs_or_lies_between_them(joined):
    organs, shared = joined
    bodies = [solid(shared.surface.mesh_of(label)) for label in organs]
    total = sum(body.volume() for body in bodies)
    for n, one in enumerate(bodies):
        for other in bodies[n + 1 :]:
            assert (one ^ other).volume() < 1e-6 * total
    # what the organs enclose together has no surface but the one that faces the outside
    surface = shared.surface
    outer = surface.triangles[surface.regions[:, 1] == 0]
    assert (surface.regions[:, 0] > surface.regions[:, 1]).all()
    assert Mesh(surface.vertices, outer).volume == pytest.approx(total, rel=1e-9)


def test_both_sides_of_a_wall_have_the_very_same_points(joined):
    _, shared = joined
    for low, high in shared.surface.pairs:
        if low == 0:
            continue
        wall = {point.tobytes() for point in shared.surface.wall(high, low).vertices}
        for label in (low, high):
            assert wall <= {point.tobytes() for point in shared.surface.mesh_of(label).vertices}


def test_walls_are_smooth_up_to_the_lines_where_they_meet(joined):
    surface = joined[1].surface
    for low, high in surface.pairs:
        assert np.abs(surface.wall(high, low).dihedrals.angles).max() < 1


def test_a_wall_between_half_balls_is_a_plane():
    shared = share_walls(organs_of(half_balls()))
    wall = shared.surface.wall(2, 1).vertices - CENTRE
    inner = np.hypot(wall[:, 1], wall[:, 2]) < RADIUS - 2
    assert wall[inner, 0].std() < 0.03
    assert np.ptp(wall[inner, 0]) < 0.15
    assert wall[:, 0].std() < 0.1


def test_the_line_where_three_sectors_meet_is_straight():
    shared = share_walls(organs_of(sectors()))
    surface = shared.surface
    inside = surface.regions.min(axis=1) > 0
    edges = np.unique(surface.junctions)
    outer = np.unique(surface.triangles[~inside])
    line = surface.vertices[np.setdiff1d(edges, outer)] - CENTRE
    assert len(line) > 15
    assert np.abs(line[:, :2].mean(axis=0)).max() < 0.2
    assert line[:, :2].std(axis=0).max() < 0.1


def test_a_mirrored_oblique_scan_gives_the_same_surfaces_moved():
    labels = half_balls()
    turn = np.array([[0.0, -1.1, 0, 5], [-1.1, 0, 0, -7], [0, 0, -1.1, 3], [0, 0, 0, 1]])
    scaled = share_walls(organs_of(labels, np.diag([1.1, 1.1, 1.1, 1]))).surface
    moved = share_walls(organs_of(labels, turn)).surface
    for label in (1, 2):
        one, other = scaled.mesh_of(label), moved.mesh_of(label)
        assert other.is_closed_manifold
        assert other.volume == pytest.approx(one.volume, rel=1e-3)


def test_a_gap_in_the_labels_stays_and_ends_of_the_scan_stay_planar():
    labels = np.zeros((24, 30, 10), int)
    labels[4:20, 4:13, :] = 1
    labels[4:20, 15:26, :] = 2
    shared = share_walls(organs_of(labels))
    assert shared.surface.pairs == [(0, 1), (0, 2)]
    height = shared.surface.vertices[:, 2]
    assert (height.min(), height.max()) == (pytest.approx(-0.5), pytest.approx(9.5))
    assert np.count_nonzero(np.abs(height - 9.5) < 1e-9) > 100


@pytest.mark.parametrize("shift", [(0, 9, 9), (9, 9, 9)], ids=["edge", "corner"])
def test_organs_that_touch_in_an_edge_or_a_corner_only_stay_closed(shift):
    labels = np.zeros((26, 26, 26), int)
    labels[4:13, 4:13, 4:13] = 1
    labels[tuple(slice(4 + step, 13 + step) for step in shift)] = 2
    shared = share_walls(organs_of(labels))
    assert shared.passing == 0
    for label in (1, 2):
        mesh = shared.surface.mesh_of(label)
        assert mesh.is_closed_manifold
        assert mesh.volume == pytest.approx(9**3, rel=0.001)


@pytest.mark.skipif(not REAL.is_file(), reason=f"{REAL} is not there")
def test_a_spinal_cord_in_its_vertebra():
    """Two labels of TotalSegmentator, one around the other, cut by the scan at both ends."""
    image = load(REAL)
    whole = np.asarray(image.dataobj)[:, :, :10]
    labels = np.where(whole == 32, 1, np.where(whole == 79, 2, 0))
    organs = organs_of(labels, image.affine)
    shared = share_walls(organs)
    assert (1, 2) in shared.surface.pairs
    for label, organ in organs.items():
        mesh = shared.surface.mesh_of(label)
        assert mesh.is_closed_manifold
        voxel = abs(np.linalg.det(image.affine))
        assert mesh.volume == pytest.approx(np.count_nonzero(organ.structure.mask) * voxel, rel=0.01)
        assert mesh.count_bodies() >= 1
