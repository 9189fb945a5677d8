"""Organs with shared walls: nothing twice, nothing left out, each closed, smooth lines where three meet."""

import functools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from manifold3d import Manifold, Mesh64
from nibabel.loadsave import load
from support import ROOT, shapes, solids

from cccd import reconstruct
from cccd.containers import Frame, Structure
from cccd.geometry.distance import unsigned_to_mesh
from cccd.geometry.mesh import Mesh
from cccd.geometry.raster import voxelise
from cccd.inputs import structure_of_array
from cccd.settings.imports import ImportSettings
from cccd.settings.surface import LoftSettings
from cccd_labels.label_fields import LabelFields, level_blocks
from cccd_labels.shared_walls import share_walls
from cccd_labels.surface_nets import surface_nets, well_composed
from cccd_labels.voxels import check_walls
from cccd_labels.wall_decimation import simplified

REAL = ROOT.parent / "shared" / "data" / "dicom_totalseg_liver20" / "labels.nii.gz"
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
    """A shell of a voxel around a core: a cortex."""
    r = ball()[3]
    return np.where(r < RADIUS - 1.2, 2, np.where(r < RADIUS, 1, 0))


def organs_of(labels, affine=None, axis=2):
    frame = Frame(np.eye(4) if affine is None else affine, axis, labels.shape)
    return {
        label: Structure("case", f"organ{label}", frame, np.zeros(3, np.int64), mask=labels == label)
        for label in range(1, int(labels.max()) + 1)
    }


def walls_of(labels, affine=None):
    return share_walls(organs_of(labels, affine), LoftSettings())


@functools.cache
def organs_and_walls(make):
    return organs_of(make()), walls_of(make())


@pytest.fixture(params=[half_balls, sectors, nested, shell], ids=lambda make: make.__name__)
def joined(request):
    return organs_and_walls(request.param)


def solid(mesh):
    return Manifold(Mesh64(mesh.vertices, mesh.faces.astype(np.uint64)))


def test_organs_are_closed_and_hold_the_volume_of_their_voxels(joined):
    organs, shared = joined
    assert shared.pinched == shared.passing == 0
    for label, organ in organs.items():
        mesh = shared.surface.mesh_of(label)
        assert mesh.is_closed_manifold
        assert mesh.volume == pytest.approx(np.count_nonzero(organ.mask), rel=0.001)


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


def test_walls_are_smooth_up_to_the_lines_where_they_meet(joined):
    surface = joined[1].surface
    for low, high in surface.pairs:
        assert np.abs(surface.wall(high, low).dihedrals.angles).max() < 1


def test_a_wall_between_half_balls_is_a_plane():
    shared = organs_and_walls(half_balls)[1]
    wall = shared.surface.wall(2, 1).vertices - CENTRE
    inner = np.hypot(wall[:, 1], wall[:, 2]) < RADIUS - 2
    assert wall[inner, 0].std() < 0.03
    assert np.ptp(wall[inner, 0]) < 0.15
    assert wall[:, 0].std() < 0.1


def test_the_line_where_three_sectors_meet_is_straight():
    surface = organs_and_walls(sectors)[1].surface
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
    scaled = walls_of(labels, np.diag([1.1, 1.1, 1.1, 1])).surface
    moved = walls_of(labels, turn).surface
    for label in (1, 2):
        one, other = scaled.mesh_of(label), moved.mesh_of(label)
        assert other.is_closed_manifold
        assert other.volume == pytest.approx(one.volume, rel=1e-3)


def test_a_gap_in_the_labels_stays_and_ends_of_the_scan_stay_planar():
    labels = np.zeros((24, 30, 10), int)
    labels[4:20, 4:13, :] = 1
    labels[4:20, 15:26, :] = 2
    labels[4:8, 13:15, :] = 2
    surface = walls_of(labels).surface
    assert surface.pairs == [(0, 1), (0, 2), (1, 2)]
    middle = np.diag([1.0, 1, 1, 1])
    middle[:3, 3] = 15, 13.5, 4.5
    for label in (1, 2):
        assert not voxelise(surface.mesh_of(label), middle, (1, 1, 1)).any()
    height = surface.vertices[:, 2]
    assert (height.min(), height.max()) == (pytest.approx(-0.5), pytest.approx(9.5))
    assert np.count_nonzero(np.abs(height - 9.5) < 1e-9) > 100


@pytest.mark.parametrize("start", [4, 13])
def test_organs_that_touch_in_an_edge_or_a_corner_only_share_no_wall(start):
    labels = np.zeros((26, 26, 26), int)
    labels[4:13, 4:13, 4:13], labels[start : start + 9, 13:22, 13:22] = 1, 2
    shared = walls_of(labels)
    assert (shared.surface.names, len(shared.surface.triangles)) == ({}, 0)


@pytest.mark.parametrize("thick", [1.05, 1.25])
def test_a_thin_bent_sheet_between_two_labels_is_whole(thick):
    *place, radius = ball((40, 40, 40))
    up = np.tensordot((0.36, 0.48, 0.8), place, 1)
    labels = np.where(radius < 14, 2, np.where(radius < 19, 3, 0)) * (up > -3)
    labels[(np.abs(radius - 14) < thick / 2) & (up > 0.34 * radius)] = 1
    mesh = walls_of(labels).surface.mesh_of(1)
    assert (mesh.count_pieces(), mesh.genus, mesh.is_closed_manifold) == (1, 0, True)
    points = mesh.sample(5000, np.random.default_rng(0)) - CENTRE
    points = points[points @ (0.36, 0.48, 0.8) > 7]  # away from the rim
    assert np.abs(np.abs(np.linalg.norm(points, axis=1) - 14) - thick / 2).mean() < 0.08


def test_a_narrow_gap_between_organs_leaves_a_ball_where_it_is():
    # another label is up to 2.2 voxels away around it, and touches it on one side
    i, j, k, radius = ball()
    labels = np.where(radius < 13, 2, 0)
    labels[np.linalg.norm((i - 1.2, j, k), axis=0) < 9], labels[radius < 8] = 0, 1
    points = walls_of(labels).surface.mesh_of(1).sample(5000, np.random.default_rng(0)) - CENTRE
    assert np.abs(np.linalg.norm(points, axis=1) - 8).mean() < 0.09


def test_an_organ_without_a_neighbour_is_where_it_is_alone():
    alone = reconstruct(organs_of(np.where(ball()[3] < RADIUS, 1, 0))[1]).lofted.mesh
    # half of it, which shares a wall with the other half, has the same outside away from the wall
    halves = organs_and_walls(half_balls)[1].surface
    outer = Mesh(halves.vertices, halves.triangles[halves.regions[:, 1] == 0])
    points = outer.sample(5000, np.random.default_rng(0))
    assert unsigned_to_mesh(points[np.abs(points[:, 0] - CENTRE[0]) > 4], alone).mean() < 0.03


@pytest.mark.parametrize("nodes", [10_000, 40_000])
def test_slabs_change_nothing(nodes, monkeypatch):
    (structure,) = organs_of(np.where(ball((32, 32, 34))[3] < RADIUS, 1, 0), np.diag([1, 1, 3.0, 1])).values()
    (whole,) = level_blocks(structure, LoftSettings())
    monkeypatch.setattr("cccd_labels.label_fields.SLAB_NODES", nodes)
    slabs = list(level_blocks(structure, LoftSettings()))
    assert len(slabs) > 1
    np.testing.assert_allclose(np.concatenate([slab.heights for slab in slabs]), whole.heights)
    assert sum(slab.volume for slab in slabs) == pytest.approx(whole.volume)
    together, apart = (LabelFields.empty([structure]) for _ in range(2))
    together.add(1, [whole])
    apart.add(1, slabs)
    np.testing.assert_array_equal(apart.best, together.best)


def test_a_dropped_fragment_goes_to_no_other_label():
    labels = half_balls()
    labels[2:4, 2:4, 2] = 1
    shared = walls_of(labels)
    for label in (1, 2):
        assert shared.surface.mesh_of(label).count_pieces() == 1
    assert any("fragment" in line for line in shared.facts[1]["warnings"])


def test_labels_may_be_added_in_any_order():
    settings, organs = LoftSettings(), organs_of(sectors())
    one, other = (LabelFields.empty(list(organs.values())) for _ in range(2))
    for number in organs:
        one.add(number, level_blocks(organs[number], settings))
    for number in reversed(organs):
        other.add(number, level_blocks(organs[number], settings))
    for name in ("owner", "best", "second"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


@pytest.mark.skipif(not REAL.is_file(), reason=f"{REAL} is not there")
def test_a_spinal_cord_in_its_vertebra():
    """Two labels of TotalSegmentator, one around the other, cut by the scan at both ends."""
    image = load(REAL)
    whole = np.asarray(image.dataobj)[:, :, :10]
    labels = np.where(whole == 32, 1, np.where(whole == 79, 2, 0))
    organs = organs_of(labels, image.affine)
    shared = share_walls(organs, LoftSettings())
    assert (1, 2) in shared.surface.pairs
    for label, organ in organs.items():
        mesh = shared.surface.mesh_of(label)
        assert mesh.is_closed_manifold
        voxel = abs(np.linalg.det(image.affine))
        assert mesh.volume == pytest.approx(np.count_nonzero(organ.mask) * voxel, rel=0.01)
        assert mesh.count_bodies() >= 1


def test_an_organ_that_passes_through_itself_says_so_with_the_number_of_places():
    labels = np.pad(np.random.default_rng(3).integers(0, 4, (24, 24, 24)), 2)
    organs = organs_of(labels)
    shared = share_walls(organs, LoftSettings())
    assert shared.passing
    for label, organ in organs.items():
        places = len(shared.surface.mesh_of(label).self_intersections())
        said = [
            line for line in shared.organ(label, organ, LoftSettings()).report["warnings"] if "itself" in line
        ]
        assert (f"in {places} place" in said[0]) if places else said == []


def half(nodes, ends, low, high):
    return np.full(len(nodes), 0.5)


@given(st.integers(0, 1_000_000), st.integers(2, 4), st.floats(0.2, 0.8), st.booleans())
def test_regions_of_noise_are_closed_manifolds_and_two_labels_stay_as_they_are(seed, count, share, even):
    random = np.random.default_rng(seed)
    labels = np.zeros((8, 8, 8), np.int32)
    labels[1:-1, 1:-1, 1:-1] = random.integers(1, count, (6,) * 3) * (random.random((6,) * 3) < share)
    deep = random.uniform(0.05, 1, labels.shape)

    def uneven(nodes, ends, low, high):
        return deep[tuple(nodes.T)] / (deep[tuple(nodes.T)] + deep[tuple(ends.T)])

    cut = half if even else uneven
    composed, pinched = well_composed(labels, lambda nodes, labels: labels.astype(float), cut)
    net = surface_nets(composed, cut)[0]
    assert all(net.mesh_of(label).is_closed_manifold for label in net.labels)
    assert pinched == 0
    assert count > 2 or np.array_equal(labels, composed)


def test_vertices_of_a_ball_lie_on_it_on_the_mean():
    place = np.indices((24,) * 3) - 11.6

    def cut(nodes, ends, low, high):
        here, there = (np.abs(np.linalg.norm(at - 11.6, axis=1) - 4) for at in (nodes, ends))
        return here / (here + there)

    net, nearer, _ = surface_nets((np.linalg.norm(place, axis=0) < 4).astype(np.int32), cut)
    volumes = [
        Mesh(vertices, net.triangles).volume / (4 / 3 * np.pi * 4**3) for vertices in (net.vertices, nearer)
    ]
    assert volumes[0] < 0.97 < 0.99 < volumes[1] < 1.01


@pytest.fixture(scope="module")
def halves():
    """Two half balls of a radius of 20 on a net whose vertices lie on the truth."""
    centre = np.array([24.3, 24.1, 24.2])
    place = np.indices((49, 49, 49)) - centre.reshape(3, 1, 1, 1)
    radius = np.linalg.norm(place, axis=0)
    labels = np.where(radius < 20, np.where(place[0] < 0, 1, 2), 0).astype(np.int32)
    net = surface_nets(labels, half)[0]
    outward = net.vertices - centre
    within = net.regions.min(axis=1) > 0
    outward[np.unique(net.triangles[within]), 0] = 0
    outer = np.isin(np.arange(len(outward)), net.triangles[~within])
    away = np.linalg.norm(outward, axis=1, keepdims=True)
    outward = np.where(outer[:, None], 20 * outward / away, outward)
    return type(net)(outward, net.triangles, net.regions)


@pytest.mark.parametrize("tolerance", [0.02, 0.05, 0.2])
def test_what_is_left_lies_on_the_walls(halves, tolerance):
    fewer = simplified(halves, tolerance)
    outer = Mesh(fewer.vertices, fewer.triangles[fewer.regions[:, 1] == 0])
    off = np.linalg.norm(outer.sample(5000, np.random.default_rng(0)), axis=1) - 20
    assert np.abs(off).mean() < tolerance
    wall = fewer.vertices[np.unique(fewer.triangles[fewer.regions.min(axis=1) > 0])]
    assert np.abs(wall[:, 0]).max() < 1e-6
    for mesh in map(fewer.mesh_of, (1, 2)):
        assert (mesh.is_closed_manifold, mesh.genus) == (True, 0)


def test_a_plane_needs_least_and_lines_keep_their_vertices(halves):
    fewer = simplified(halves, 0.05)
    flat, bent = ((surface.regions.min(axis=1) > 0) for surface in (fewer, halves))
    assert flat.sum() < 0.35 * bent.sum()
    assert len(fewer.triangles) < 0.4 * len(halves.triangles)
    lines = [{point.tobytes() for point in one.vertices[one.junctions.ravel()]} for one in (fewer, halves)]
    assert lines[0] == lines[1]


def test_where_a_wall_would_tear_only_what_is_beside_keeps_more():
    place = np.indices((49,) * 3) - 24.2
    bars = (place[:2] % 10 < 3).any(axis=0) & (place[2] % 10 < 3) & (np.linalg.norm(place, axis=0) < 21)
    labels = well_composed(bars.astype(np.int32), lambda nodes, labels: labels.astype(float), half)[0]
    net = surface_nets(labels, half)[0]
    fewer = simplified(net, 0.1)
    assert len(fewer.triangles) < 0.2 * len(net.triangles)
    assert fewer.mesh_of(1).is_closed_manifold


def test_shared_walls_are_checked_by_the_organ_s_voxels():
    structure = structure_of_array(shapes.ball(), np.eye(4), ImportSettings())
    mesh = solids.sphere(20.0, (30.0, 30.0, 30.0))
    assert check_walls(mesh, structure) == []
    vertices = mesh.vertices.copy()
    vertices[0] += 20 * mesh.vertex_normals[0]  # a needle
    (line,) = check_walls(Mesh(vertices, mesh.faces), structure)
    place = [float(number) for number in line[line.rindex("(") + 1 : line.rindex(")")].split(",")]
    assert "from the organ's voxels" in line
    assert np.abs(place - vertices[0]).max() <= 0.05
