"""Surfaces of several regions: what one region leaves the other enters."""

import numpy as np

from cccd.geometry.mesh import Mesh
from cccd_labels.conforming import ConformingSurface, read_conforming, write_conforming
from cccd_labels.surface_nets import split_again, split_quads


def two_tetrahedra():
    points = np.array([(0.0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0, -1)])
    triangles = np.array([(0, 1, 2), (0, 1, 3), (1, 2, 3), (0, 3, 2), (0, 2, 4), (0, 4, 1), (1, 4, 2)])
    regions = np.array([(2, 1), (1, 0), (1, 0), (1, 0), (2, 0), (2, 0), (2, 0)])
    return ConformingSurface(points, triangles, regions, {1: "upper", 2: "lower"})


def test_each_region_is_closed_and_faces_outwards():
    both = two_tetrahedra()
    for label in both.labels:
        mesh = both.mesh_of(label)
        assert mesh.is_closed_manifold
        assert abs(mesh.volume - 1 / 6) < 1e-12


def test_a_wall_seen_from_either_side_is_the_same_triangles_turned_round():
    both = two_tetrahedra()
    up, down = both.wall(2, 1), both.wall(1, 2)
    assert np.array_equal(up.face_normals, -down.face_normals)
    assert np.array_equal(up.vertices, down.vertices)


def test_a_file_gives_back_what_was_written(tmp_path):
    both = two_tetrahedra()
    write_conforming(tmp_path / "walls.h5", both, {})
    back = read_conforming(tmp_path / "walls.h5")
    assert back.names == both.names
    assert back.pairs == both.pairs
    for name in ("vertices", "triangles", "regions"):
        assert np.array_equal(getattr(back, name), getattr(both, name))


def test_quads_whose_corners_moved_are_split_where_they_do_not_fold():
    # a square whose last corner went beyond the diagonal between its neighbours, in every order of corners
    corners = np.array([(0.0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0)])
    for turn in range(4):
        quad = np.roll(np.arange(4), turn)[None]
        flat = ConformingSurface(corners, split_quads(corners, quad), np.array([(1, 0), (1, 0)]))
        bent = corners.copy()
        bent[3] = (1.2, 0.8, 0)  # below the line from the first to the third
        mesh = split_again(ConformingSurface(bent, flat.triangles, flat.regions), quad)
        normals = Mesh(bent, mesh.triangles).face_normals[:, 2]
        assert (normals > 0).all()
        assert np.array_equal(np.sort(np.unique(mesh.triangles)), np.arange(4))
        np.testing.assert_allclose(normals.sum() / 2, 1.6)  # the area of its outline
