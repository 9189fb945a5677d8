import locale
import re
import shutil
import subprocess
import sys
import zipfile
from dataclasses import replace

import nibabel
import numpy as np
import pytest
import pyvista
import trimesh
from support.shapes import ball, fork, lofted

from cccd.containers import Frame
from cccd.errors import InputError
from cccd.extras import EXTRAS
from cccd.files import ExportOptions, write_surface
from cccd.geometry.mesh import Mesh
from cccd.geometry.subdivision import SHARP, ControlMesh
from cccd.plugins import formats
from cccd.settings.surface import LoftSettings
from cccd.store import write_control_meshes
from cccd.surface.surface import LoftedSurface, read_surface


@pytest.fixture(scope="module")
def surface():
    return lofted(fork())


@pytest.fixture(scope="module")
def small():
    return lofted(ball((20, 20, 20), (10, 10, 10), 6))


@pytest.mark.parametrize("suffix", ["ply", "stl", "obj"])
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


def test_vtp_says_its_frame_and_has_curvature_and_the_body_at_its_vertices(surface, tmp_path):
    write_surface(tmp_path / "surface.vtp", surface)
    mesh = pyvista.read(tmp_path / "surface.vtp")
    assert mesh.n_points == len(surface.vertices)
    assert list(mesh.field_data["Space"]) == ["RAS"]
    values = mesh.point_data
    assert set(np.unique(values["body"])) == set(range(len(surface.bodies)))
    assert np.median(values["curvature"]) > 0


def program(name, package):
    if shutil.which(name) is None:
        pytest.skip(f"{name} is not installed (Debian's {package})")
    return name


def test_gifti_is_read_by_nibabel_and_by_connectome_workbench(surface, tmp_path):
    path = tmp_path / "fork.surf.gii"
    write_surface(path, surface, ExportOptions("fork"))
    points, triangles = nibabel.load(path).agg_data(("pointset", "triangle"))
    np.testing.assert_allclose(points, surface.vertices, atol=1e-4)
    assert np.array_equal(triangles, surface.faces)
    done = subprocess.run(
        [program("wb_command", "connectome-workbench"), "-surface-information", path],
        capture_output=True,
        text=True,
        check=True,
    )
    told = {
        line.split(":")[0].strip(): line.split(":")[1].split()
        for line in done.stdout.splitlines()
        if ":" in line
    }
    assert int(told["Number of Vertices"][0]) == len(surface.vertices)
    assert int(told["Number of Triangles"][0]) == len(surface.faces)


def test_3mf_is_in_millimetres_with_a_colour_and_its_thinnest_wall(surface, tmp_path):
    pytest.importorskip("lib3mf")
    spoken = locale.setlocale(locale.LC_ALL)
    write_surface(tmp_path / "fork.3mf", surface, ExportOptions("fork"))
    assert locale.setlocale(locale.LC_ALL) == spoken
    with zipfile.ZipFile(tmp_path / "fork.3mf") as held:
        model = held.read("3D/3dmodel.model").decode()
    assert 'unit="millimeter"' in model
    assert 'displaycolor="#CC7866' in model
    thinnest = float(re.search(r'thinnest_wall_mm"[^>]*>([0-9.]+)<', model)[1])
    assert 1 < thinnest < np.ptp(surface.vertices, axis=0).min()


def test_prusa_slicer_slices_a_3mf_without_repair(surface, tmp_path):
    pytest.importorskip("lib3mf")
    slicer = program("prusa-slicer", "prusa-slicer")
    write_surface(tmp_path / "fork.3mf", surface, ExportOptions("fork"))
    told = subprocess.run(
        [slicer, "--info", "fork.3mf"], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    facts = dict(re.findall(r"(\w+) = ([\w.]+)", told.stdout))
    assert facts["manifold"] == "yes"
    assert float(facts["volume"]) == pytest.approx(surface.mesh.volume, rel=1e-3)
    assert not {"open_edges", "facets_reversed", "edges_fixed", "degenerate_facets"} & set(facts)
    slicing = [
        slicer,
        "--export-gcode",
        "--dont-arrange",
        "--center",
        "100,100",
        "-o",
        "fork.gcode",
        "fork.3mf",
    ]
    subprocess.run(slicing, cwd=tmp_path, capture_output=True, check=True)
    assert (tmp_path / "fork.gcode").stat().st_size > 10000


def spline_surface():
    """Two bodies, one with sharp edges and a cavity in it."""
    corners = np.array([(x, y, z) for z in (-1.0, 1) for y in (-1.0, 1) for x in (-1.0, 1)])
    sides = np.array([(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)])
    rim = np.array([(0, 1), (1, 3), (2, 3), (0, 2)])
    bodies = [
        ControlMesh(8 * corners, sides, rim, np.array([SHARP, SHARP, 1.5, 0.5])),
        ControlMesh(2 * corners + 0.1, sides[:, ::-1]),
        ControlMesh(3 * corners + (40, 0, 0), sides),
    ]
    bodies = [body.rounded(1e-3) for body in bodies]
    whole = trimesh.util.concatenate([body.tessellate(2).to_trimesh() for body in bodies])
    mesh = Mesh(np.array(whole.vertices), np.array(whole.faces, np.int64))
    return LoftedSurface(bodies, mesh, Frame(np.eye(4), 2, (8, 8, 8)))


@pytest.mark.parametrize("suffix", ["usd", "usda", "usdc"])
def test_usd_has_the_control_meshes_exactly(tmp_path, suffix):
    reason = "usd-core is not installed"
    usd, geom = (pytest.importorskip(f"pxr.{name}", reason=reason) for name in ("Usd", "UsdGeom"))
    surface = spline_surface()
    path = tmp_path / f"surface.{suffix}"
    write_surface(path, surface, ExportOptions("heart"))
    assert path.read_bytes().startswith(b"#usda" if suffix == "usda" else b"PXR-USDC")
    stage = usd.Stage.Open(str(path))
    assert geom.GetStageMetersPerUnit(stage) == 0.001
    assert geom.GetStageUpAxis(stage) == "Z"
    assert stage.GetDefaultPrim().GetDisplayName() == "heart"
    meshes = [geom.Mesh(prim) for prim in stage.GetDefaultPrim().GetChildren()]
    assert [mesh.GetPrim().GetName() for mesh in meshes] == ["body_1", "cavity_1", "body_2"]
    for mesh, body in zip(meshes, surface.bodies, strict=True):
        assert mesh.GetSubdivisionSchemeAttr().Get() == "catmullClark"
        assert mesh.GetOrientationAttr().Get() == "rightHanded"
        assert np.array_equal(np.array(mesh.GetPointsAttr().Get(), float), body.vertices)
        assert set(mesh.GetFaceVertexCountsAttr().Get()) == {4}
        assert np.array_equal(np.array(mesh.GetFaceVertexIndicesAttr().Get()), body.quads.ravel())
        assert geom.Mesh.ValidateTopology(
            mesh.GetFaceVertexIndicesAttr().Get(), mesh.GetFaceVertexCountsAttr().Get(), len(body.vertices)
        )[0]
        assert len(mesh.GetDisplayColorAttr().Get()) == 1
    assert np.array_equal(np.array(meshes[0].GetCreaseIndicesAttr().Get()), surface.bodies[0].creases.ravel())
    assert list(meshes[0].GetCreaseLengthsAttr().Get()) == [2, 2, 2, 2]
    assert list(meshes[0].GetCreaseSharpnessesAttr().Get()) == [SHARP, SHARP, 1.5, 0.5]
    assert geom.Mesh.SHARPNESS_INFINITE == SHARP
    assert not meshes[1].GetCreaseIndicesAttr().HasAuthoredValue()


def test_usd_of_a_surface_without_splines_is_its_triangles(surface, tmp_path):
    usd, geom = (pytest.importorskip(f"pxr.{name}") for name in ("Usd", "UsdGeom"))
    plain = replace(surface, bodies=[])
    write_surface(tmp_path / "surface.usdc", plain)
    stage = usd.Stage.Open(str(tmp_path / "surface.usdc"))
    (prim,) = stage.GetDefaultPrim().GetChildren()
    assert geom.Mesh(prim).GetSubdivisionSchemeAttr().Get() == "none"
    assert len(geom.Mesh(prim).GetFaceVertexCountsAttr().Get()) == len(surface.faces)


def test_a_mesh_of_shared_walls_has_no_control_meshes(tmp_path):
    surface = spline_surface()
    smoothed = replace(surface, mesh=surface.mesh.low_passed(0.1, 5))
    for name, written in (("own", surface), ("walls", smoothed)):
        write_surface(tmp_path / f"{name}.ply", written)
    write_control_meshes(tmp_path / "surface.h5", surface.bodies, surface.frame, surface.report)
    assert len(read_surface(tmp_path / "surface.h5", tmp_path / "own.ply").bodies) == 3
    assert read_surface(tmp_path / "surface.h5", tmp_path / "walls.ply").bodies == []


@pytest.mark.parametrize("name", formats())
def test_every_format_that_the_configuration_knows_is_written(surface, small, tmp_path, name):
    for module in EXTRAS.get(formats()[name].extra, ()):
        pytest.importorskip(module)
    if name == "seg.dcm":
        pytest.skip("lies on a DICOM series: tests/unit/dicom/test_dicom_out.py")
    path = tmp_path / f"surface.{name}"
    coarse = LoftSettings(tetrahedra={"edge_mm": 5, "tolerance_mm": 1})
    of_mesh = formats()[name].made_of == "mesh"  # others take longer
    write_surface(path, surface if of_mesh else small, ExportOptions("organ", settings=coarse))
    assert path.stat().st_size > 1000
    assert list(tmp_path.iterdir()) == [path]


def test_a_failed_write_leaves_no_file(surface, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "OCP.Message", None)
    with pytest.raises(InputError, match="pip install"):
        write_surface(tmp_path / "surface.step", surface)
    assert list(tmp_path.iterdir()) == []
