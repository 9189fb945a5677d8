import importlib.util
import sys

import numpy as np
import pytest
import trimesh
from shapes import SETTINGS, curves_of, fork

from cccd.errors import InputError
from cccd.settings.surface import SURFACE_FORMATS
from cccd.store import write_patches
from cccd.surface import loft_surface
from cccd.surface.export import Scan, read_surface, write_surface


@pytest.fixture(scope="module")
def surface():
    return loft_surface(curves_of(fork()), SETTINGS)


def test_ply_reads_back_exactly(surface, tmp_path):
    write_surface(tmp_path / "surface.ply", surface)
    write_patches(tmp_path / "surface.h5", surface.patches, surface.frame, surface.report)
    back = read_surface(tmp_path / "surface.h5", tmp_path / "surface.ply")
    assert np.array_equal(back.vertices, surface.vertices)
    assert np.array_equal(back.faces, surface.faces)
    assert back.report == surface.report
    assert np.array_equal(back.patches[0].control_points, surface.patches[0].control_points)


@pytest.mark.parametrize("suffix", ["ply", "stl"])
def test_other_programs_read_the_mesh(surface, tmp_path, suffix):
    path = tmp_path / f"surface.{suffix}"
    write_surface(path, surface)
    mesh = trimesh.load(path)
    assert mesh.is_watertight
    assert mesh.bounds == pytest.approx(
        np.array([surface.vertices.min(axis=0), surface.vertices.max(axis=0)]), abs=1e-4
    )
    assert b"SPACE=RAS" in path.read_bytes()[:400]
    assert b"mm" in path.read_bytes()[:400]


def test_glb_is_in_metres_with_y_up(surface, tmp_path):
    write_surface(tmp_path / "surface.glb", surface)
    scene = trimesh.load(tmp_path / "surface.glb")
    x, y, z = surface.vertices.T
    expected = np.array([[x.min(), z.min(), -y.max()], [x.max(), z.max(), -y.min()]]) / 1000
    assert scene.bounds == pytest.approx(expected, abs=1e-6)


def test_vtp_says_its_frame(surface, tmp_path):
    pyvista = pytest.importorskip("pyvista")
    write_surface(tmp_path / "surface.vtp", surface)
    mesh = pyvista.read(tmp_path / "surface.vtp")
    assert mesh.n_points == len(surface.vertices)
    assert list(mesh.field_data["Space"]) == ["RAS"]


@pytest.mark.parametrize("name", SURFACE_FORMATS)
def test_every_format_that_the_configuration_knows_is_written(surface, tmp_path, name):
    if name == "step":
        pytest.importorskip("OCP")
    path = tmp_path / f"surface.{name}"
    write_surface(path, surface, Scan("fork"))
    assert path.stat().st_size > 1000
    assert list(tmp_path.iterdir()) == [path]


def test_an_unknown_format_names_the_known_ones(surface, tmp_path):
    with pytest.raises(InputError, match=r"\.step"):
        write_surface(tmp_path / "surface.unknown", surface)


def test_a_failed_write_leaves_no_file(surface, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "OCP", None)
    monkeypatch.setitem(sys.modules, "OCP.BRepBuilderAPI", None)
    with pytest.raises(InputError, match="pip install"):
        write_surface(tmp_path / "surface.step", surface)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(importlib.util.find_spec("OCP") is None, reason="cadquery-ocp-novtk is not installed")
def test_step_reads_back_as_the_same_splines(surface, tmp_path):
    from OCP.BRep import BRep_Tool
    from OCP.Geom import Geom_BSplineSurface
    from OCP.STEPControl import STEPControl_Reader
    from OCP.TopAbs import TopAbs_FACE
    from OCP.TopExp import TopExp_Explorer
    from OCP.TopoDS import TopoDS

    path = tmp_path / "surface.step"
    write_surface(path, surface)
    reader = STEPControl_Reader()
    reader.ReadFile(str(path))
    reader.TransferRoots()
    explorer = TopExp_Explorer(reader.OneShape(), TopAbs_FACE)
    found = []
    while explorer.More():
        found.append(BRep_Tool.Surface_s(TopoDS.Face(explorer.Current())))
        explorer.Next()
    splines = [face for face in found if isinstance(face, Geom_BSplineSurface)]
    assert len(splines) == len(surface.patches)
    rng = np.random.default_rng(0)
    for patch, face in zip(surface.patches, splines, strict=True):
        u, v = rng.random(20), rng.random(20) * patch.knots_v[-1]
        there = [face.Value(float(a), float(b)) for a, b in zip(u, v, strict=True)]
        assert face.IsUPeriodic()
        assert np.array([[p.X(), p.Y(), p.Z()] for p in there]) == pytest.approx(
            patch.evaluate(u, v), abs=1e-7
        )
