"""Solids as OpenCASCADE writes them and reads them back."""

import numpy as np
import pytest
from support.closed_shapes import box, nested, ring, sphere
from support.refusals import refusal

from cccd.geometry.mesh import Mesh
from cccd_solids.build import build_solids, write_solids

pytest.importorskip("OCP", reason="cadquery-ocp-novtk is not installed")

from OCP import BRep, BRepTools, IFSelect, IGESControl, STEPControl, TopAbs, TopoDS

from cccd_solids.kernel import Part, check_solid, count_shapes, make_solid, write_parts


def shapes_of(mesh):
    """OpenCASCADE's solids of a mesh."""
    return [make_solid([shell.build() for shell in body]) for body in build_solids(mesh, 0.2).bodies]


def read(path):
    """Read a file back as one shape."""
    if path.suffix == ".brep":
        shape = TopoDS.TopoDS_Shape()
        assert BRepTools.BRepTools.Read_s(shape, str(path), BRep.BRep_Builder())
        return shape
    reader = STEPControl.STEPControl_Reader() if path.suffix == ".step" else IGESControl.IGESControl_Reader()
    assert reader.ReadFile(str(path)) == IFSelect.IFSelect_RetDone
    reader.TransferRoots()
    return reader.OneShape()


@pytest.fixture(scope="module")
def bodies():
    mesh = nested()
    return mesh, build_solids(mesh, 0.2)


@pytest.mark.parametrize("form", ["step", "iges", "brep"])
def test_every_body_is_a_valid_closed_solid(bodies, tmp_path, form):
    mesh, solids = bodies
    path = tmp_path / f"organ.{form}"
    report = write_solids(path, "organ", solids, form)
    assert report["valid"]
    assert report["free_edges"] == 0
    assert report["warnings"] == []
    assert (report["bodies"], report["cavities"]) == (3, 1)
    assert (report["smooth_shells"], report["faceted_shells"]) == (4, 0)
    assert report["p99_mm"] <= 0.2
    assert report["bytes"] == path.stat().st_size
    assert report["volume_ml"] * 1000 == pytest.approx(mesh.volume, rel=5e-3)
    found = check_solid(read(path))
    assert found.valid
    assert found.free_edges == 0
    assert found.volume / 1000 == pytest.approx(report["volume_ml"], rel=1e-4)
    assert count_shapes(read(path), TopAbs.TopAbs_SOLID) == 3
    assert count_shapes(read(path), TopAbs.TopAbs_SHELL) == 4


def test_step_says_unit_names_and_colours(tmp_path):
    path = tmp_path / "case.step"
    one, around, other = (shapes_of(mesh) for mesh in (box(), ring(), box((1, 1, 1))))
    write_parts(path, [Part("liver", one, (1.0, 0.0, 0.0)), Part("lungs", [*around, *other])], "step")
    text = path.read_text()
    assert "ap242" in text
    assert "SI_UNIT(.MILLI.,.METRE.)" in text
    for name in ("liver", "lungs", "lungs 1"):
        assert f"PRODUCT('{name}'" in text
    assert "DRAUGHTING_PRE_DEFINED_COLOUR('red')" in text or "COLOUR_RGB('',1.," in text
    assert count_shapes(read(path), TopAbs.TopAbs_SOLID) == 3


def test_a_tolerance_out_of_reach_is_said_and_the_solid_holds(tmp_path):
    report = write_solids(
        tmp_path / "a.step", "a", build_solids(sphere(), 1e-4, most_quads=60, most_facets=200), "step"
    )
    assert report["valid"]
    assert report["faces"] <= 200
    assert any("step_tolerance_mm" in line for line in report["warnings"])


def test_an_open_mesh_is_refused():
    ball = sphere()
    assert "not closed" in refusal(build_solids, Mesh(ball.vertices, ball.faces[1:]), 0.2)


def test_solids_are_the_same_in_every_run(tmp_path):
    first, second = (build_solids(ring(), 0.1) for _ in range(2))
    assert np.array_equal(first.bodies[0][0].mesh.vertices, second.bodies[0][0].mesh.vertices)
    assert first.report == second.report
