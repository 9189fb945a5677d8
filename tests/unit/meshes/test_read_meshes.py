"""Meshes of others are read as they are: closed where they are, in mm RAS, whatever the format."""

import numpy as np
import pytest
import trimesh

import cccd
from cccd.errors import InputError
from cccd.geometry import subdivision
from cccd.store import write_control_meshes
from cccd_meshes import read_meshes
from cccd_meshes.read_meshes import is_mesh, read_mesh

AFFINE = np.diag([-1.0, -1, 1.5, 1]) @ np.array([[1, 0, 0, 5], [0, 1, 0, -20], [0, 0, 1, 8], [0, 0, 0, 1.0]])


@pytest.fixture(scope="module")
def surface():
    at = np.indices((26, 26, 18)) - np.array([13, 12, 9]).reshape(3, 1, 1, 1)
    return cccd.reconstruct(np.hypot(np.hypot(at[0], at[1]), 1.5 * at[2]) <= 9, AFFINE)


@pytest.mark.parametrize("form", ["ply", "stl", "obj", "glb", "vtp", "gii"])
def test_what_was_written_is_read_back(surface, form, tmp_path):
    path = tmp_path / f"organ.{form}"
    surface.write(path)
    found = read_mesh(path)
    assert found.notes == ()
    assert found.mesh.is_closed_manifold
    assert len(found.mesh.faces) == len(surface.faces)
    assert found.mesh.volume == pytest.approx(surface.volume, rel=1e-6)
    assert found.mesh.vertices.min(axis=0) == pytest.approx(surface.vertices.min(axis=0), abs=1e-5)


def test_splines_alone_have_as_many_triangles_as_the_mesh_of_all(surface, tmp_path, monkeypatch):
    bodies = [surface.bodies[0], surface.bodies[0].transformed(AFFINE)]
    quads = len(bodies[0].quads)
    for module in (subdivision, read_meshes):
        monkeypatch.setattr(module, "LARGE", 1.5 * quads, raising=False)  # both are many, each alone is not
    write_control_meshes(tmp_path / "surface.h5", bodies, surface.lofted.frame, surface.lofted.report)
    assert len(read_mesh(tmp_path / "surface.h5").mesh.faces) == 8 * 2 * quads


@pytest.mark.parametrize("form", ["step", "iges", "brep"])
def test_a_solid_becomes_a_closed_mesh_of_its_volume(surface, form, tmp_path):
    pytest.importorskip("OCP")
    surface.write(tmp_path / f"organ.{form}")
    mesh = read_mesh(tmp_path / f"organ.{form}").mesh
    assert mesh.is_closed_manifold
    (body,) = surface.bodies
    assert mesh.volume == pytest.approx(body.tessellate(5).volume, rel=1e-3)
    assert mesh.vertices.max(axis=0) == pytest.approx(surface.vertices.max(axis=0), abs=0.05)


def test_slicer_s_meshes_are_turned_from_lps(tmp_path):
    box = trimesh.creation.box((2, 4, 6))
    box.apply_translation((10, 20, 30))
    header = "# 3D Slicer output. SPACE=LPS\n"
    (tmp_path / "box.obj").write_text(header + box.export(file_type="obj"))
    mesh = read_mesh(tmp_path / "box.obj").mesh
    assert mesh.vertices.mean(axis=0) == pytest.approx([-10, -20, 30])
    assert mesh.volume == pytest.approx(48)


def test_gltf_in_millimetres_is_noticed(tmp_path):
    box = trimesh.creation.box((40, 60, 80))
    box.export(tmp_path / "box.glb")
    found = read_mesh(tmp_path / "box.glb")
    assert found.mesh.volume == pytest.approx(40 * 60 * 80)
    assert "mm" in found.notes[0]


def test_what_is_no_surface_is_refused_in_one_line(tmp_path):
    (tmp_path / "broken.stl").write_bytes(b"solid nothing")
    (tmp_path / "points.ply").write_text(
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n"
        "end_header\n0 0 0\n"
    )
    for name in ("broken.stl", "points.ply", "absent.obj", "scan.nii.gz"):
        with pytest.raises(InputError, match=name):
            read_mesh(tmp_path / name)
    assert not is_mesh(tmp_path / "scan.nii.gz")
    assert is_mesh(tmp_path / "A.STP")
