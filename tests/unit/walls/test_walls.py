"""Splines through shared walls: the same seams, faces and volumes on both sides."""

import functools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cccd.containers import Frame, Structure
from cccd.geometry.decimation import CORNER, SEAM, WITHIN, Seams
from cccd.geometry.distance import unsigned_to_mesh
from cccd.geometry.mesh import Mesh
from cccd.settings.surface import LoftSettings
from cccd.surface.surface import LoftedSurface
from cccd_labels.shared_walls import share_walls
from cccd_labels.surface_nets import surface_nets, well_composed
from cccd_solids.build import Solids
from cccd_walls.complexes import WallComplex, split_fans
from cccd_walls.files import read_spline, write_spline
from cccd_walls.solids import better, build_together
from cccd_walls.splines import fit_organs, fit_walls

RADIUS = 11.0
TOLERANCE = 0.2


def sectors(cut=0):
    """Three sectors of a ball; the first slices may be missing."""
    x, y, z = (np.indices((30,) * 3) - np.reshape([14.6, 14.3, 14.8], (3, 1, 1, 1)))[:, :, :, cut:]
    third = np.floor((np.arctan2(y, x) + np.pi) / (2 * np.pi / 3)).astype(int).clip(0, 2)
    return np.where(np.hypot(np.hypot(x, y), z) < RADIUS, 1 + third, 0)


@functools.cache
def organs(cut=0):
    """Their surfaces, on voxels that are turned in space."""
    labels = sectors(cut)
    affine = np.array([(0.0, 0, 1, 3), (1, 0, 0, -5), (0, 1, 0, 7), (0, 0, 0, 1)])
    frame, origin = Frame(affine, 2, labels.shape), np.zeros(3, np.int64)
    parts = {n: Structure("ball", f"part{n}", frame, origin, mask=labels == n) for n in (1, 2, 3)}
    walls = share_walls(parts, LoftSettings()).surface
    return {walls.names[n]: LoftedSurface([], walls.mesh_of(n), frame) for n in walls.labels}


@functools.cache
def complex_of(cut=0):
    surfaces = list(organs(cut).values())
    return WallComplex.welded([surface.mesh for surface in surfaces], surfaces[0].frame)


def meshes_of(walls, faces):
    """Closed meshes of the organs; ``faces`` (n, 3) are those of whole walls in the order of ``walls``."""
    regions = walls.regions[walls.wall]
    for organ in range(1, int(regions.max()) + 1):
        own, other = regions[:, 0] == organ, regions[:, 1] == organ
        yield Mesh(walls.vertices, np.concatenate([faces[own], faces[other][:, ::-1]])).compact()


def test_sectors_meet_in_a_line_between_two_corners():
    walls = complex_of()
    assert (len(walls.regions), (walls.seams.kinds == CORNER).sum()) == (6, 2)
    line = walls.vertices[(walls.seams.kinds == SEAM)]
    assert np.hypot(*(line - line.mean(axis=0))[:, :2].T).max() == pytest.approx(RADIUS, rel=0.06)
    volume = sum(surface.mesh.volume for surface in organs().values())
    assert sum(mesh.volume for mesh in meshes_of(walls, walls.triangles)) == pytest.approx(volume)


def test_the_rim_of_a_plane_where_the_scan_cuts_is_a_seam():
    walls = complex_of(cut=10)
    flat = np.all(walls.vertices[walls.triangles, 2] == walls.vertices[:, 2].min(), axis=1)
    assert set(np.unique(walls.wall[flat])) & set(np.unique(walls.wall[~flat])) == set()
    assert flat.any()


def test_fans_that_meet_at_a_vertex_alone_part():
    faces = np.array([(0, 1, 2), (0, 2, 3), (0, 3, 1), (1, 3, 2)])
    both = np.concatenate([faces, np.where(faces == 0, 0, faces + 3)])
    parted, vertex = split_fans(both)
    assert np.array_equal(vertex[parted], both)
    assert np.bincount(vertex).tolist() == [2, 1, 1, 1, 1, 1, 1]
    assert Mesh(np.zeros((len(vertex), 3)), parted).is_closed_manifold


def half(nodes, ends, low, high):
    return np.full(len(nodes), 0.5)


@settings(deadline=None, max_examples=12)
@given(st.integers(0, 2**32 - 1), st.integers(2, 4))
def test_collapsed_walls_of_noise_keep_their_topology(seed, count):
    random = np.random.default_rng(seed)
    labels = np.zeros((7,) * 3, np.int32)
    labels[1:-1, 1:-1, 1:-1] = random.integers(1, count + 1, (5,) * 3) * (random.random((5,) * 3) < 0.7)
    labels, _ = well_composed(labels, lambda nodes, labels: labels.astype(float), half)
    net = surface_nets(labels, half)[0]
    walls = WallComplex.welded([net.mesh_of(label) for label in net.labels])
    fewer = walls.collapsed(len(walls.triangles) // 4)
    assert len(fewer.triangles) < len(walls.triangles)
    before, after = (
        [(mesh.is_closed_manifold, mesh.genus, mesh.count_pieces()) for mesh in meshes_of(w, w.triangles)]
        for w in (walls, fewer)
    )
    assert before == after
    corners = [w.vertices[w.seams.kinds == CORNER] for w in (walls, fewer)]
    assert np.array_equal(*[points[np.lexsort(points.T)] for points in corners])
    seams = walls.vertices[walls.seams.kinds > WITHIN]
    assert all((seams == point).all(axis=1).any() for point in fewer.vertices[fewer.seams.kinds == SEAM])


@pytest.mark.parametrize("cut", [0, 10])
def test_the_spline_lies_on_the_walls_and_neighbours_share_their_seams(cut):
    walls = complex_of(cut)
    spline = fit_walls(walls, TOLERANCE)
    assert spline.crossing == 0
    drawn = spline.control.tessellate(2)
    drawn_wall = np.tile(spline.wall, 2 * 4**2)
    off: list[np.ndarray] = []
    for wall in range(len(walls.regions)):
        patch = Mesh(drawn.vertices, drawn.faces[drawn_wall == wall]).compact()
        truth = Mesh(walls.vertices, walls.triangles[walls.wall == wall]).compact()
        off += [unsigned_to_mesh(patch.vertices, truth), unsigned_to_mesh(truth.vertices, patch)]
        assert patch.area == pytest.approx(truth.area, rel=0.02)
    assert np.percentile(np.concatenate(off), 99) < TOLERANCE
    assert set(Seams.of(drawn.faces, drawn_wall, len(drawn.vertices)).uses) - {2} == {3}


def test_a_spline_comes_back_from_its_file(tmp_path):
    spline, frame = fit_organs(organs(), TOLERANCE), organs()["part1"].frame
    write_spline(tmp_path / "wall_splines.h5", spline, frame, {})
    back = read_spline(tmp_path / "wall_splines.h5")
    assert (back.organs, back.crossing) == (spline.organs, spline.crossing)
    assert np.array_equal(back.regions, spline.regions)
    for wall in range(len(spline.regions)):
        assert np.array_equal(*(one.control.quads[one.wall == wall] for one in (back, spline)))
    for name in ("vertices", "creases", "sharpness", "corners"):
        assert np.array_equal(getattr(back.control, name), getattr(spline.control, name))


def test_an_organ_alone_has_no_walls(tmp_path):
    surface = organs()["part1"]
    write_spline(tmp_path / "none.h5", fit_organs({"alone": surface}, TOLERANCE), surface.frame, {})
    assert len(read_spline(tmp_path / "none.h5").control.quads) == 0


@pytest.mark.parametrize("cut", [0, 10])
def test_solids_of_neighbours_have_the_same_faces(cut):
    top, kinds = pytest.importorskip("OCP.TopExp"), pytest.importorskip("OCP.TopAbs")
    from cccd_solids.kernel import check_solid, make_solid

    surfaces = organs(cut)
    solids = build_together(surfaces, fit_organs(surfaces, TOLERANCE), TOLERANCE)
    assert all(found.warnings == [] for found in solids.values())
    assert all(found.report["common_faces"] for found in solids.values())
    assert all(found.report["planar_faces"] == (cut > 0) for found in solids.values())
    shapes = [make_solid([shell.build() for shell in found.bodies[0]]) for found in solids.values()]
    faces = []
    for shape, surface in zip(shapes, surfaces.values(), strict=True):
        checked = check_solid(shape)
        assert (checked.valid, checked.free_edges) == (True, 0)
        assert checked.volume == pytest.approx(surface.mesh.volume, rel=5e-3)
        explorer = top.TopExp_Explorer(shape, kinds.TopAbs_FACE)
        faces.append([])
        while explorer.More():
            faces[-1].append(explorer.Current())
            explorer.Next()
    for one, other in ((0, 1), (1, 2), (0, 2)):
        assert sum(face.IsSame(its) for face in faces[one] for its in faces[other]) > 1


def test_an_organ_whose_common_faces_are_far_off_has_a_spline_of_its_own():
    surface, far = organs()["part1"], Solids([], {"p99_mm": 2 * TOLERANCE, "volume_ratio": 1.0}, ["far off"])
    found = better(far, surface, TOLERANCE)
    assert found.warnings == []
    assert found.bodies[0][0].mesh.volume == pytest.approx(surface.mesh.volume, rel=5e-3)
