import hashlib
import os

import h5py
import numpy as np
import pandas as pd
import pytest
import trimesh
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from support.refusals import refusal
from support.solids import torus

from cccd import store
from cccd.containers import Boundaries, Curves, FittedCurves, Frame, Splines, Structure
from cccd.errors import InputError
from cccd.geometry.arrays import concatenate_ragged
from cccd.geometry.mesh import Mesh
from cccd.geometry.subdivision import ControlMesh
from cccd.store import read_ply, read_table, write_ply, write_table
from cccd.surface.control_mesh import join_in_pairs, split_to_quads
from cccd_viewers import page_files as pages
from cccd_workflow import stage_files

FRAME = Frame(np.array([[0, 2.0, 0, 5], [1.5, 0, 0, -3], [0, 0, 3.0, 7], [0, 0, 0, 1]]), 2, (30, 40, 20))

finite = st.floats(-1e6, 1e6, width=64)


@st.composite
def ragged(draw):
    lengths = draw(st.lists(st.integers(0, 6), max_size=5))
    parts = [draw(hnp.arrays(float, (n, 2), elements=finite)) for n in lengths]
    points, offsets = concatenate_ragged(parts)
    slices = np.sort(draw(hnp.arrays(np.int32, len(parts), elements=st.integers(0, 19))))
    holes = draw(hnp.arrays(bool, len(parts)))
    return Curves(points, offsets, slices, holes, FRAME)


def assert_same(one, other):
    for name, value in vars(one).items():
        if isinstance(value, Frame):
            assert_same(value, getattr(other, name))
        elif isinstance(value, np.ndarray):
            np.testing.assert_array_equal(value, getattr(other, name))
        else:
            assert value == getattr(other, name)


@settings(max_examples=30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(curves=ragged())
def test_curves_come_back(tmp_path, curves):
    codes = np.arange(len(curves.points), dtype=np.uint8) % 8
    splines = Splines(
        curves.points, curves.offsets, np.arange(5.0), np.zeros(len(curves) + 1, np.int64),
        curves.slice, curves.hole, 3, FRAME,
    )  # fmt: skip
    path = tmp_path / "curves.h5"
    fitted = FittedCurves(curves, codes, curves.points, curves.offsets, splines, {"a": [1, None]})
    stage_files.write_curves(path, fitted)
    assert_same(curves, stage_files.read_curves(path))
    assert_same(splines, stage_files.read_splines(path))
    with h5py.File(path) as file:
        np.testing.assert_array_equal(file["chain_codes/codes"], codes)
    assert store.read_report(path) == {"a": [1, None]}
    assert list(tmp_path.iterdir()) == [path]


def test_structure_boundaries_and_control_meshes_come_back(tmp_path):
    rng = np.random.default_rng(0)
    structure = Structure(
        "c", "o", FRAME, np.array([1, 2, 3]),
        image=rng.normal(size=(3, 4, 5)).astype(np.float32),
        mask=rng.random((3, 4, 5)) > 0.5,
        truth=Mesh(rng.normal(size=(4, 3)), np.array([[0, 1, 2], [0, 2, 3]])),
        provenance={"files": {"ü.nii": "00"}}, warnings=["w"],
    )  # fmt: skip
    store.write_structure(tmp_path / "s.h5", structure)
    back = store.read_structure(tmp_path / "s.h5")
    np.testing.assert_array_equal(back.image, structure.image)
    np.testing.assert_array_equal(back.mask, structure.mask)
    np.testing.assert_array_equal(back.truth.faces, structure.truth.faces)
    assert back.boundary is None
    assert back.contours is None
    assert (back.provenance, back.warnings) == (structure.provenance, structure.warnings)

    boundaries = Boundaries(
        np.array([[1, 2], [3, 4]], np.int32), np.array([0, 2]), np.array([7], np.int32), FRAME
    )
    stage_files.write_boundaries(tmp_path / "b.h5", boundaries)
    assert_same(boundaries, stage_files.read_boundaries(tmp_path / "b.h5"))

    box = trimesh.creation.box()
    points, quads, _ = split_to_quads(
        np.array(box.vertices), *join_in_pairs(Mesh(np.array(box.vertices), np.array(box.faces, np.int64)))
    )
    body = ControlMesh(points, quads, np.array([[0, 1]]), np.array([10.0]))
    store.write_control_meshes(tmp_path / "p.h5", [body] * 11, FRAME, {})
    back = store.read_bodies(tmp_path / "p.h5")
    assert len(back) == 11
    for name in ("vertices", "quads", "creases", "sharpness"):
        np.testing.assert_array_equal(getattr(back[10], name), getattr(body, name))


def test_nets_of_an_older_version_are_named_with_a_cure(tmp_path):
    with h5py.File(tmp_path / "surface.h5", "w") as file:
        file.create_group("patches")
    with pytest.raises(InputError, match=r"surface\.h5.*older version.*loft it again"):
        store.read_bodies(tmp_path / "surface.h5")


def test_same_content_gives_the_same_bytes(tmp_path):
    digests = set()
    for name in ("a.h5", "b.h5"):
        structure = Structure("c", "o", FRAME, np.zeros(3), mask=np.ones((20, 20, 20), bool))
        store.write_structure(tmp_path / name, structure)
        digests.add(hashlib.sha256((tmp_path / name).read_bytes()).hexdigest())
    assert len(digests) == 1


def test_a_failed_write_leaves_the_old_file_and_nothing_else(tmp_path):
    path = tmp_path / "x.json"
    store.write_json(path, {"n": np.int64(1), "nan": float("nan")})
    before = path.read_bytes()
    assert before == b'{\n  "n": 1,\n  "nan": null\n}\n'
    with pytest.raises(TypeError):
        store.write_json(path, {"n": object()})
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_files_are_readable_by_others(tmp_path):
    old = os.umask(0o022)
    try:
        store.write_json(tmp_path / "x.json", {})
    finally:
        os.umask(old)
    assert (tmp_path / "x.json").stat().st_mode & 0o777 == 0o644


def test_a_file_of_an_older_layout_is_named(tmp_path):
    path = tmp_path / "structure.h5"
    store.write_structure(path, Structure("c", "o", FRAME, np.zeros(3)))
    assert "older layout" in refusal(stage_files.read_curves, path)


def test_figures_come_back_panel_by_panel(tmp_path):
    layers = {"boundary": np.array([[1.0, 2.5], [3.0, 4.0]]), "links": np.zeros((0, 2, 2))}
    panels = [
        pages.Panel(f"panel {n}", layers, "two\nlines", "row") for n in range(12)
    ]  # ten sorts before two
    whole = pages.SliceFigure(
        panels, 4, np.array([[0, 1], [6, 8]]), np.arange(56, dtype=np.uint8).reshape(7, 8)
    )
    bare = pages.SliceFigure(panels[:1])
    pages.write_figures(tmp_path / "f.h5", {"whole": whole, "bare": bare})
    for name, figure in (("whole", whole), ("bare", bare)):
        found = pages.read_figure(tmp_path / "f.h5", name)
        assert found.columns == figure.columns
        assert [panel.title for panel in found.panels] == [panel.title for panel in figure.panels]
        assert found.panels[-1].detail == "two\nlines"
        assert found.panels[-1].row == "row"
        for layer, points in layers.items():
            np.testing.assert_array_equal(found.panels[-1].layers[layer], points)
        for one, other in ((found.window, figure.window), (found.image, figure.image)):
            assert (one is None) == (other is None)
            np.testing.assert_array_equal(one, other)
    assert pages.read_figure(tmp_path / "f.h5", "another") is None


def test_a_panel_of_a_picture_alone_comes_back(tmp_path):
    pages.write_figures(
        tmp_path / "f.h5", {"raw": pages.SliceFigure([pages.Panel("slice", {})], 1, image=np.eye(3))}
    )
    (panel,) = pages.read_figure(tmp_path / "f.h5", "raw").panels
    assert panel.layers == {}


@pytest.mark.parametrize("reference", ["", "the truth"])
def test_a_view_comes_back(tmp_path, reference):
    mesh = Mesh(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]), np.array([[0, 2, 1], [0, 1, 3]]))
    values = {"curvature": np.arange(4.0)} | ({"distance": -np.arange(4.0)} if reference else {})
    view = pages.View({"surface": mesh}, values, 99, reference, {"dropped": np.array([True, False])})
    pages.write_view(tmp_path / "view.h5", view)
    found = pages.read_view(tmp_path / "view.h5")
    assert (found.triangles, found.reference, set(found.values)) == (99, reference, set(values))
    np.testing.assert_array_equal(found.meshes["surface"].vertices, mesh.vertices)
    np.testing.assert_array_equal(found.meshes["surface"].faces, mesh.faces)
    for name, column in values.items():
        np.testing.assert_array_equal(found.values[name], column)
    np.testing.assert_array_equal(found.flags["dropped"], [True, False])


@pytest.mark.parametrize("table", [pd.DataFrame(), pd.DataFrame(columns=["case", "organ"])])
def test_a_table_that_is_absent_or_without_rows_is_none(tmp_path, table):
    assert read_table(tmp_path / "table.csv") is None
    write_table(tmp_path / "table.csv", table)
    assert read_table(tmp_path / "table.csv") is None


def test_a_mesh_comes_back_to_the_last_bit(tmp_path):
    mesh = torus()
    write_ply(tmp_path / "a.ply", mesh, "unit mm")
    back = read_ply(tmp_path / "a.ply")
    assert np.array_equal(back.vertices, mesh.vertices)
    assert np.array_equal(back.faces, mesh.faces)
    assert b"\ncomment unit mm\n" in (tmp_path / "a.ply").read_bytes()[:200]
    other = trimesh.load(tmp_path / "a.ply", process=False)
    assert np.array_equal(other.faces, mesh.faces)


def test_half_a_file_and_other_meshes_are_refused(tmp_path):
    write_ply(tmp_path / "a.ply", torus(), "unit mm")
    whole = (tmp_path / "a.ply").read_bytes()
    (tmp_path / "half.ply").write_bytes(whole[: len(whole) // 2])
    torus().to_trimesh().export(tmp_path / "other.ply")
    for name in ("half.ply", "other.ply"):
        assert "not a mesh that the lofting wrote" in refusal(read_ply, tmp_path / name)
