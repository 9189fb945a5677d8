"""Walls are as thick as asked for, and ends are cut square, flat and by name, in every file."""

import numpy as np
import pytest
import pyvista
import trimesh
from support.refusals import refusal
from support.solids import mesh_of
from support.tubes import Tube, straight, voxels
from test_centrelines import FINE, lines_of_fork, mesh_of_fork, mesh_of_tubes

from cccd.cli import main
from cccd.errors import InputError
from cccd.geometry.distance import to_mesh
from cccd.inputs.nifti_export import write_nifti
from cccd_vessels.centrelines import find_centrelines
from cccd_vessels.ends import clear_ends, find_ends, opened
from cccd_vessels.hollow import hollow_wall
from cccd_vessels.named import write_named


@pytest.fixture(scope="module")
def forked():
    return mesh_of_fork(FINE), lines_of_fork(FINE)


@pytest.mark.parametrize("outwards", [False, True])
def test_the_wall_of_a_sphere_is_as_thick_as_asked_for(outwards):
    ball = mesh_of(trimesh.creation.icosphere(5, 15.0))
    outer, inner = hollow_wall(ball, 2.0, outwards, "ball")
    radii = np.linalg.norm(outer.vertices, axis=1).mean(), np.linalg.norm(inner.vertices, axis=1).mean()
    assert radii[0] - radii[1] == pytest.approx(2, rel=0.03)
    other = outer if outwards else inner
    assert np.abs(to_mesh(other.vertices, ball)) == pytest.approx(np.full(len(other.vertices), 2), rel=0.03)
    whole = opened([(outer, "outer"), (inner, "inner")], [], "ball")
    assert whole.mesh.is_closed_manifold
    assert len(whole.mesh.self_intersections()) == 0
    low, high = (15, 17) if outwards else (13, 15)
    assert whole.mesh.volume == pytest.approx(4 / 3 * np.pi * (high**3 - low**3), rel=0.01)
    assert whole.mesh.count_bodies() == 1


def test_the_wall_of_a_tube_is_as_thick_as_asked_for():
    lumen = mesh_of_tubes([straight((0, 0, 0), (6, 4, 36), 6.0)])
    outer, _ = hollow_wall(lumen, 1.5, True, "tube")
    between = np.abs(outer.vertices[:, 2] - 18) < 9
    assert to_mesh(outer.vertices[between], lumen) == pytest.approx(1.5, rel=0.03)


def test_a_wall_that_fills_the_body_is_refused():
    ball = mesh_of(trimesh.creation.icosphere(4, 5.0))
    assert "no cavity is left; choose a thinner wall" in refusal(hollow_wall, ball, 6.0, False, "ball")
    assert "0 is no thickness" in refusal(hollow_wall, ball, 0.0, False, "ball")
    assert "needs a grid of" in refusal(hollow_wall, ball, 0.01, False, "ball")


def test_ends_are_flat_square_and_named(forked):
    mesh, found = forked
    ends = find_ends(found, "fork")
    cut = opened([(mesh, "wall")], ends, "fork")
    assert cut.names == ("wall", "inlet", "outlet_1", "outlet_2")
    assert cut.mesh.is_closed_manifold
    assert len(cut.mesh.self_intersections()) == 0
    assert cut.mesh.genus == 0
    assert 0.8 * mesh.volume < cut.mesh.volume < mesh.volume
    ways = {
        "inlet": (0, 0, -1),
        "outlet_1": found.branches[1].tangents[-1],
        "outlet_2": found.branches[2].tangents[-1],
    }
    for end in ends:
        cap = cut.group(end.name)
        assert np.abs((cap.vertices - end.point) @ end.outward).max() < 1e-9
        assert cap.unit_normals @ end.outward == pytest.approx(1)
        assert end.outward @ np.asarray(ways[end.name]) > np.cos(np.radians(3))
        radius = 6.0 if end.name == "inlet" else 4.5
        assert cap.area == pytest.approx(np.pi * radius**2, rel=0.04)
    # nothing else has moved by more than what keeps slivers away
    wall = cut.group("wall")
    assert np.abs(to_mesh(wall.vertices, mesh)).max() < 0.05


def test_a_wall_with_open_ends_has_rims(forked):
    lumen, found = forked
    outer, inner = hollow_wall(lumen, 1.5, True, "fork")
    layers = [(outer, "outer"), (inner, "inner")]
    ends, closed = clear_ends(layers, find_ends(found, "fork"))
    assert closed == []
    wall = opened(layers, ends, "fork")
    assert wall.mesh.is_closed_manifold
    assert len(wall.mesh.self_intersections()) == 0
    assert wall.mesh.genus == 2  # a fork of pipes: three openings
    assert wall.group("inlet").area == pytest.approx(np.pi * (7.5**2 - 6**2), rel=0.05)


def test_an_end_within_another_wall_stays_closed():
    lumen = mesh_of_tubes([straight((0, 0, 0), (0, 0, 60), 4.0), straight((10, 0, 0), (10, 0, 40), 4.0)])
    found = find_centrelines(lumen, 1.0)
    outer, inner = hollow_wall(lumen, 3.0, True, "pair")
    layers = [(outer, "outer"), (inner, "inner")]
    ends, closed = clear_ends(layers, find_ends(found, "pair"))
    assert len(ends) + len(closed) == 4
    assert len(closed) == 3
    assert all("stays closed: another branch runs within the wall" in line for line in closed)
    wall = opened(layers, ends, "pair")
    assert wall.mesh.is_closed_manifold
    assert len(wall.mesh.self_intersections()) == 0


def test_a_tube_without_ends_is_refused():
    angle = np.linspace(0, 2 * np.pi, 1000)
    ring = Tube(18 * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle]), 5.0, flat=False)
    found = find_centrelines(mesh_of_tubes([ring]), 1.0)
    with pytest.raises(InputError, match=r"no branch has a free end.*cut the mask open"):
        find_ends(found, "ring")


@pytest.fixture(scope="module")
def cut(forked):
    mesh, found = forked
    return opened([(mesh, "wall")], find_ends(found, "fork"), "fork")


def areas(cut):
    return {name: cut.group(name).area for name in cut.names}


def test_vtk_reads_the_groups(cut, tmp_path):
    write_named(tmp_path / "fork.vtp", cut, "fork")
    data = pyvista.read(tmp_path / "fork.vtp")
    names = data.field_data["group_names"]
    sizes = np.bincount(data["group"], data.compute_cell_sizes()["Area"])[1:]
    assert dict(zip(names, sizes, strict=True)) == pytest.approx(areas(cut))


@pytest.mark.parametrize("suffix", ["stl", "obj"])
def test_trimesh_reads_the_groups(cut, tmp_path, suffix):
    write_named(tmp_path / f"fork.{suffix}", cut, "fork")
    scene = trimesh.load(tmp_path / f"fork.{suffix}", force="scene", split_object=True, group_material=False)
    if suffix == "stl":
        assert {name: part.area for name, part in scene.geometry.items()} == pytest.approx(
            areas(cut), rel=1e-5
        )
    else:
        whole = trimesh.load(tmp_path / "fork.obj", force="mesh")
        assert whole.is_watertight
        assert whole.volume == pytest.approx(cut.mesh.volume, rel=1e-6)


def test_gmsh_reads_the_boundaries_of_the_tetrahedra(tmp_path):
    pytest.importorskip("pytetwild")
    gmsh = pytest.importorskip("gmsh")
    mesh = mesh_of(trimesh.creation.cylinder(4.0, 36.0, sections=32))
    cut = opened([(mesh, "wall")], find_ends(find_centrelines(mesh, 1.0), "duct"), "duct")
    assert set(cut.names) == {"wall", "inlet", "outlet_1"}
    write_named(tmp_path / "duct.msh", cut, "duct")
    gmsh.initialize(["-noenv"], interruptible=False)
    try:
        gmsh.option.set_number("General.Terminal", 0)
        gmsh.open(str(tmp_path / "duct.msh"))
        numbers, places, _ = gmsh.model.mesh.get_nodes()
        place = np.zeros((int(numbers.max()) + 1, 3))
        place[numbers] = places.reshape(-1, 3)
        found = {}
        for dimension, tag in gmsh.model.get_physical_groups():
            name = gmsh.model.get_physical_name(dimension, tag)
            size = 0.0
            for entity in gmsh.model.get_entities_for_physical_group(dimension, tag):
                kinds, _, nodes = gmsh.model.mesh.get_elements(dimension, entity)
                for kind, ids in zip(kinds, nodes, strict=True):
                    assert kind == {2: 2, 3: 4}[dimension]
                    corners = place[ids].reshape(-1, dimension + 1, 3)
                    edges = corners[:, 1:] - corners[:, :1]
                    if dimension == 2:
                        size += np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1).sum() / 2
                    else:
                        size += np.abs(np.linalg.det(edges)).sum() / 6
            found[name] = size
    finally:
        gmsh.finalize()
    assert found.pop("duct") == pytest.approx(cut.mesh.volume, rel=0.02)
    assert found == pytest.approx(areas(cut), rel=0.04)


WRONG = {
    "lumen duct.nii.gz -o duct.ply": "'.ply' is no format with named boundaries",
    "hollow duct.nii.gz --thickness 1 --root 1,2,3 -o a.stl": "without --open-ends",
    "hollow duct.nii.gz --thickness 9 -o a.stl": "no cavity is left",
    "lumen wall.vtp --label 2 -o a.stl": "a mesh has no labels",
}


def test_the_commands_cut_and_hollow_and_refuse(here, capsys, refused):
    mask, affine = voxels([straight((0, 0, 0), (6, 4, 36), 5.0)], FINE)
    write_nifti(here / "duct.nii.gz", mask.astype(np.uint8), affine)
    assert main(["lumen", "duct.nii.gz", "-o", "duct.stl"]) == 0
    assert "outlet_1:" in capsys.readouterr().out
    assert main(["hollow", "duct.nii.gz", "--thickness", "1.5", "--open-ends", "-o", "wall.vtp"]) == 0
    printed = capsys.readouterr().out
    assert all(f"  {name}: " in printed for name in ("outer", "inner", "inlet", "outlet_1"))
    for command, words in WRONG.items():
        assert words in refused(*command.split())
    assert not list(here.glob("a.*"))
