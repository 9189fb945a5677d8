"""Control meshes as solids: faces of their own patches, planes for their caps."""

import itertools

import numpy as np
import pytest
from scipy.interpolate import BSpline
from support.control_meshes import CORNERS, bumpy, cube, pill, polygon_area, torus, turned

from cccd.containers import Frame
from cccd.files import ExportOptions, write_surface
from cccd.geometry.subdivision import SHARP, ControlMesh
from cccd.surface.control_mesh import split_to_quads
from cccd.surface.surface import LoftedSurface
from cccd_solids.quad_faces import QuadFaces, flattened
from cccd_solids.spline_shell import SplineShell, grid_ids, spline_shell_of

FRAME = Frame(np.eye(4), 2, (8, 8, 8))


def surface_of(*bodies):
    meshes = [body.tessellate(2) for body in bodies]
    return LoftedSurface(list(bodies), meshes[0], FRAME)


def inside_out(mesh):
    return ControlMesh(mesh.vertices, mesh.quads[:, ::-1], mesh.creases, mesh.sharpness)


def split_cube():
    none = np.zeros((0, 3), np.int64)
    return ControlMesh(*split_to_quads(CORNERS, cube().quads, none)[:2])


SHAPES = [bumpy(), bumpy(flat=True), turned(bumpy(flat=True)), cube(SHARP), pill(), torus(), split_cube()]


@pytest.mark.parametrize("mesh", SHAPES)
def test_every_edge_lies_between_two_faces(mesh):
    faces = QuadFaces.of(flattened(mesh))
    wires = [wire for face in faces.wires() for wire in face]
    heads = [head for wire in wires for head in wire]
    assert sorted(heads) == faces.heads.tolist()
    other = faces.links.twin[faces.tail[heads]]
    assert sorted(other.tolist()) == sorted(heads)
    assert len(faces.edges) * 2 == len(heads)
    for wire in wires:
        ends = faces.links.origin[faces.links.twin[faces.tail[wire]]]
        assert np.array_equal(ends, np.roll(faces.links.origin[wire], -1))


def test_neighbours_share_the_points_of_their_edge():
    ids = grid_ids(cube().quads, 5)
    assert len(np.unique(ids)) == 8 + 12 * 3 + 6 * 9
    sides = [face[:, (0, -1)].T.tolist() + face[(0, -1), :].tolist() for face in ids]
    edges = sorted(
        tuple(side) if side[0] < side[-1] else tuple(side[::-1]) for face in sides for side in face
    )
    assert edges[::2] == edges[1::2]


def test_quads_of_one_polygon_become_one_face():
    faces = QuadFaces.of(split_cube())
    assert (faces.face.max() + 1, len(faces.fours), len(faces.edges)) == (6, 6, 12)


def test_caps_become_planes_however_they_are_turned():
    for mesh in (bumpy(flat=True), turned(bumpy(flat=True))):
        faces = QuadFaces.of(flattened(mesh))
        assert len(faces.normals) == 1
    assert len(QuadFaces.of(bumpy()).normals) == 0


def test_flattening_moves_by_what_was_rounded():
    mesh = turned(bumpy(flat=True))
    assert 0 < np.abs(flattened(mesh).vertices - mesh.vertices).max() < 2e-3


@pytest.mark.parametrize("halved", [0, 1])
@pytest.mark.parametrize("mesh", [bumpy(), bumpy(flat=True), torus(), split_cube()])
def test_shells_are_closed_and_near_the_limit(mesh, halved):
    shell = SplineShell.of(mesh, halved)
    assert shell.mesh.is_closed_manifold
    assert shell.mesh.volume == pytest.approx(shell.limit.volume, rel=2e-3 / 4**halved)
    assert len(shell.mesh.self_intersections()) == 0


def test_quads_are_halved_where_normals_jump():
    assert spline_shell_of(torus()).halved == 0
    shell = spline_shell_of(cube(size=10.0))
    assert shell.halved == 1
    assert shell.jumps.mean() <= 0.3
    assert SplineShell.of(cube(size=10.0)).jumps.mean() > 0.3


def solid(path, surface):
    pytest.importorskip("OCP", reason="cadquery-ocp-novtk is not installed")
    return write_surface(path, surface, ExportOptions("organ"))


def test_a_cube_is_six_planes(tmp_path):
    report = solid(tmp_path / "cube.step", surface_of(cube(SHARP)))
    assert report["valid"]
    assert (report["faces"], report["planar_faces"]) == (6, 6)
    assert report["volume_ml"] * 1000 == pytest.approx(8, abs=1e-9)
    assert report["largest_mm"] < 1e-9


def test_a_pill_has_flat_caps_and_walls_as_exact_as_rounded_points(tmp_path):
    report = solid(tmp_path / "pill.step", surface_of(pill()))
    square = np.array([(-1.0, -1), (1, -1), (1, 1), (-1, 1)])
    rim = BSpline(np.arange(11) - 3, np.concatenate([square, square[:3]]), 3)(np.linspace(0, 4, 40001)[:-1])
    assert report["valid"]
    assert (report["faces"], report["planar_faces"]) == (6, 2)
    assert report["volume_ml"] * 1000 == pytest.approx(2 * polygon_area(rim), rel=1e-4)


COARSE = list(itertools.product([turned(bumpy(1, flat=True)), bumpy(1, seed=3)], ["step", "iges", "brep"]))


@pytest.mark.parametrize(("mesh", "form"), COARSE)
def test_bodies_with_cavities_are_valid_and_read_back(mesh, form, tmp_path):
    path = tmp_path / f"organ.{form}"
    cavity = cube(size=3.0)
    report = solid(path, surface_of(mesh, inside_out(cavity), inside_out(cube(SHARP).moved(CORNERS + 4.0))))
    assert report["valid"]
    assert report["free_edges"] == 0
    assert report["warnings"] == []
    assert (report["bodies"], report["cavities"], report["faceted_shells"]) == (1, 2, 0)
    assert report["self_intersections"] == 0
    assert report["normal_jump_mean_deg"] <= 0.3
    assert report["normal_jump_p99_deg"] <= 3
    assert report["p99_mm"] < 0.05
    assert report["bytes"] == path.stat().st_size
    wanted = mesh.tessellate(4).volume - cavity.tessellate(4).volume - 8
    assert report["volume_ml"] * 1000 == pytest.approx(wanted, rel=2e-3)
    from test_solids import read

    from cccd_solids.kernel import check_solid

    found = check_solid(read(path))
    assert found.valid
    assert found.free_edges == 0
    assert found.faces == report["faces"]
    assert found.volume == pytest.approx(report["volume_ml"] * 1000, rel=1e-4)


def test_no_point_stands_twice_in_a_step_file(tmp_path):
    path = tmp_path / "organ.step"
    solid(path, surface_of(bumpy()))
    points = [line.split("=", 1)[1] for line in path.read_text().splitlines() if "CARTESIAN_POINT" in line]
    assert len(points) == len(set(points)) > 100


def test_solids_of_splines_are_the_same_in_every_run(tmp_path):
    first, second = (tmp_path / name for name in ("a.brep", "b.brep"))
    for path in (first, second):
        solid(path, surface_of(bumpy(flat=True)))
    assert first.read_bytes() == second.read_bytes()
