"""A number of triangles, or their edges' length: closed, even, on the spline, with rims kept."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

import cccd
from cccd.errors import InputError
from cccd.geometry.distance import to_mesh
from cccd.geometry.mesh import Mesh
from cccd_meshes.uniform import uniform_mesh


@pytest.fixture(scope="module")
def ring():
    i, j, k = np.indices((60, 60, 26)) - np.array([30, 30, 13]).reshape(3, 1, 1, 1)
    return cccd.reconstruct(np.hypot(np.hypot(i, j) - 17, 2 * k) <= 9, np.diag([1, 1, 2, 1]))


def edges_of(mesh):
    ends = mesh.vertices[mesh.dihedrals.edges]
    return np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)


def shapes_of(mesh):
    """Return 1 for an equilateral triangle, 0 for a flat one."""
    corners = mesh.vertices[mesh.faces]
    sides = (corners - np.roll(corners, 1, axis=1)) ** 2
    return 4 * 3**0.5 * mesh.face_areas / sides.sum(axis=(1, 2))


@pytest.mark.parametrize("count", [600, 3000])
def test_as_many_triangles_as_asked_for(ring, count):
    even = ring.uniform(triangles=count).lofted
    mesh, said = even.mesh, even.report["uniform"]
    assert len(mesh.faces) == pytest.approx(count, rel=0.02)
    assert mesh.is_closed_manifold
    assert (mesh.genus, mesh.count_bodies(), len(mesh.self_intersections())) == (1, 1, 0)
    lengths = edges_of(mesh)
    assert lengths.std() / lengths.mean() < 0.2
    assert lengths.max() < 2.5 * lengths.mean()
    assert shapes_of(mesh).min() > 0.4
    fine = ring.bodies[0].tessellate(4)
    off = np.abs(to_mesh(fine.vertices, mesh)).max()
    assert said["chord_error_mm"] == pytest.approx(off, abs=0.05)
    assert np.abs(to_mesh(mesh.vertices, fine)).max() < 0.05  # of a pixel, as of the PLY mesh
    assert said["edge_mm"] == pytest.approx([lengths.min(), lengths.mean(), lengths.max()])


def test_few_triangles_keep_tips_and_the_spline_s_interval():
    at = (np.indices((70, 24, 24)) - np.array([34.5, 11.5, 11.5]).reshape(3, 1, 1, 1)).T / (32, 9, 9)
    spindle = cccd.reconstruct((np.linalg.norm(at, axis=-1) <= 1).T)
    few = spindle.uniform(triangles=200)
    assert few.size[0] > 0.95 * spindle.size[0]  # .91 where vertices move to the middle through the inside
    assert (few.volume_interval, few.intervals) == (spindle.volume_interval, spindle.intervals)
    assert few.lofted.report["uniform"]["spline_ml"] == pytest.approx(spindle.volume / 1000)


def test_more_triangles_lie_nearer_by_the_square_of_their_edges(ring):
    few, many = (ring.uniform(triangles=n).lofted.report["uniform"]["chord_error_mm"] for n in (750, 6000))
    assert many < few / 4


@pytest.mark.parametrize("edge", [2.0, 4.0])
def test_edges_are_as_long_as_asked_for(ring, edge):
    assert edges_of(ring.uniform(edge_mm=edge).lofted.mesh).mean() == pytest.approx(edge, rel=0.03)


def test_the_rims_of_caps_stay_sharp():
    """The scan cuts a bar at both ends: the caps stay planes, and their rims circles."""
    i, j = np.indices((30, 30)) - 14.5
    mask = np.repeat((i**2 + j**2 < 10**2)[:, :, None], 16, axis=2)
    bar = cccd.reconstruct(mask, np.diag([1.0, 1.0, 2.0, 1.0]))
    mesh = bar.uniform(triangles=1500).lofted.mesh
    assert mesh.is_closed_manifold
    for end in (-1.0, 31.0):
        cap = np.abs(mesh.vertices[:, 2] - end) < 1e-3
        flat = cap[mesh.faces].all(axis=1)
        assert mesh.face_areas[flat].sum() == pytest.approx(np.pi * 10**2, rel=0.04)
    assert mesh.volume == pytest.approx(bar.volume, rel=0.01)


@pytest.mark.parametrize("count", [1200, 2500])
def test_no_triangle_at_the_rim_of_a_cut_is_a_sliver(count):
    i, j, k = np.indices((26, 24, 16))
    mask = ((i - 12.5) / 10.3) ** 2 + ((j - 11.2) / 7.7) ** 2 + ((k + 2) / 12) ** 2 < 1
    mesh = cccd.reconstruct(mask, np.eye(4)).uniform(triangles=count).mesh
    assert mesh.is_watertight
    assert np.degrees(mesh.face_angles).min() > 3


def test_bands_and_formats_go_along(ring, tmp_path):
    even = ring.uniform(triangles=2000)
    assert even.lofted.band is not None
    assert len(even.lofted.band.inner) == len(even.vertices)
    even.write(tmp_path / "ring.stl")
    read = trimesh.load_mesh(tmp_path / "ring.stl")
    assert read.is_watertight
    assert len(read.faces) == 2000


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({}, "one of --triangles and --edge-mm is needed"),
        ({"triangles": 500, "edge_mm": 2}, "one of --triangles and --edge-mm is needed"),
        ({"triangles": -5}, "--triangles: -5 is not positive"),
        ({"edge_mm": 0.001}, "--edge-mm: 0.001 makes .* triangles; ask for 2000000 at most"),
        ({"triangles": 4}, "--triangles: 4 makes 4 triangles, too few for the shape; ask for 60 at least"),
        ({"edge_mm": 50}, "--edge-mm: 50 makes .* triangles, too few for the shape"),
    ],
)
def test_one_line_says_what_cannot_be(ring, asked, said):
    with pytest.raises(InputError, match=said):
        ring.uniform(**asked)


def test_organs_that_share_walls_are_refused(ring):
    shared = replace(ring, lofted=replace(ring.lofted, bodies=[]))
    with pytest.raises(
        InputError, match="neighbours that share a wall keep its triangles; choose one --label"
    ):
        shared.uniform(triangles=500)


def test_two_thin_sheets_do_not_cross():
    """Bent plates half a millimetre apart, in triangles of two: the gap between them stays open."""
    plate = trimesh.creation.box((40, 40, 4)).subdivide_to_size(0.9)
    bent = np.array(plate.vertices)
    bent[:, 2] += 3 * np.sin(bent[:, 0] / 6)
    faces = np.array(plate.faces, np.int64)
    fine = Mesh(
        np.concatenate([bent, bent + np.array((0, 0, 4.5))]), np.concatenate([faces, faces + len(bent)])
    )
    assert fine.is_closed_manifold
    even = uniform_mesh(fine, 2000)
    assert even.is_closed_manifold
    assert len(even.self_intersections()) == 0
