import sys

import numpy as np
import pytest
import trimesh
from shapes import SETTINGS, curves_of, fork

from cccd.errors import InputError
from cccd.settings.surface import SOLID_FORMATS, SURFACE_FORMATS, TETRAHEDRA_FORMATS, TetrahedraSettings
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
    if name in SOLID_FORMATS:
        pytest.importorskip("OCP")
    if name in TETRAHEDRA_FORMATS:
        pytest.importorskip("pytetwild")
    path = tmp_path / f"surface.{name}"
    coarse = TetrahedraSettings(edge_mm=10, tolerance_mm=0.5)
    write_surface(path, surface, Scan("fork", tetrahedra=coarse))
    assert path.stat().st_size > 1000
    assert list(tmp_path.iterdir()) == [path]


def test_an_unknown_format_names_the_known_ones(surface, tmp_path):
    with pytest.raises(InputError, match=r"\.step"):
        write_surface(tmp_path / "surface.unknown", surface)


def test_a_failed_write_leaves_no_file(surface, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "OCP.Message", None)
    with pytest.raises(InputError, match="pip install"):
        write_surface(tmp_path / "surface.step", surface)
    assert list(tmp_path.iterdir()) == []
