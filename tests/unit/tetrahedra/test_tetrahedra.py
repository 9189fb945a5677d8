"""Tetrahedra through several organs: one conforming mesh, whose regions and boundaries are the organs'."""

import json
import subprocess
import sys
import time

import numpy as np
import psutil
import pytest
import pyvista
import trimesh
from support.bars import FRAME, HALF, SETTINGS, WIDTH, calculix, elastic, needs_calculix, two_halves
from support.refusals import refusal
from support.solids import box, mesh_of, sphere

import cccd
from cccd.containers import Frame
from cccd.errors import InputError
from cccd.geometry.mesh import Mesh
from cccd_tetrahedra.build import fill_and_measure
from cccd_tetrahedra.chords import balance_chords
from cccd_tetrahedra.files import WRITERS
from cccd_tetrahedra.filling import _bounded, fill_organs
from cccd_tetrahedra.quality import warnings_of
from cccd_tetrahedra.shapes import FACES, dihedral_angles, radius_ratios, signed_volumes

pytest.importorskip("pytetwild", reason="the extra fe is not installed")


@pytest.fixture(scope="module")
def bar():
    return fill_and_measure(two_halves(), SETTINGS, dict.fromkeys(two_halves(), FRAME))


def boundary(tetrahedra):
    """Faces of tetrahedra that are in one of them only, outwards."""
    faces = tetrahedra[:, FACES].reshape(-1, 3)
    _, index, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    assert count.max() == 2
    return faces[index[count == 1]]


def as_sets(faces):
    return {tuple(face) for face in np.sort(faces, axis=1).tolist()}


def test_each_organ_is_closed_and_keeps_its_volume(bar):
    filled, report = bar
    assert filled.volumes.min() > 0
    for n, (name, surface) in enumerate(two_halves().items()):
        mesh = Mesh(filled.vertices, boundary(filled.tetrahedra[filled.regions == n]))
        assert mesh.is_closed_manifold
        assert report["organs"][name]["volume_ratio"] == pytest.approx(1, abs=2e-3)
        expected = surface.volume - (two_halves()["tumour"].volume if name == "left" else 0)
        assert mesh.volume == pytest.approx(expected, rel=5e-3)


def test_neighbours_share_the_faces_of_their_wall(bar):
    filled, _ = bar
    left, right, tumour = (as_sets(boundary(filled.tetrahedra[filled.regions == n])) for n in range(3))
    wall = filled.group("interface_left_right")
    assert as_sets(wall) == left & right
    assert as_sets(filled.group("interface_left_tumour")) == tumour
    assert np.abs(filled.vertices[wall][:, :, 2]).max() < SETTINGS.tolerance_mm
    assert Mesh(filled.vertices, wall).area == pytest.approx(WIDTH**2, rel=0.02)
    assert as_sets(boundary(filled.tetrahedra)) == as_sets(
        np.concatenate(
            [filled.group(f"{kind}_{name}") for kind in ("wall", "cut") for name in ("left", "right")]
        )
    )


def test_the_ends_of_the_scan_cut(bar):
    filled, report = bar
    assert set(report["groups"]) == {
        *("cut_left", "cut_right", "wall_left", "wall_right"),
        *("interface_left_right", "interface_left_tumour"),
    }
    for name, z in (("left", -HALF), ("right", HALF)):
        faces = filled.group(f"cut_{name}")
        assert filled.vertices[faces][:, :, 2] == pytest.approx(z, abs=SETTINGS.tolerance_mm)
        assert Mesh(filled.vertices, faces).area == pytest.approx(WIDTH**2, rel=0.05)
        assert Mesh(filled.vertices, faces).unit_normals[:, 2] * np.sign(z) == pytest.approx(1, abs=0.2)


def test_each_organ_is_cut_by_its_own_scan():
    """Two boxes side by side, whose scans end on different planes."""
    boxes = {
        name: mesh_of(trimesh.creation.box((8.0, 8.0, 8.0)), (x, 0, 0))
        for name, x in (("short", 0), ("long", 20))
    }
    affine = np.array([[1, 0, 0, -10.0], [0, 1, 0, -10], [0, 0, 1, -3.5], [0, 0, 0, 1]])
    below = affine - np.array([[0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 20], [0, 0, 0, 0]])
    frames = {"short": Frame(affine, 2, (40, 40, 20)), "long": Frame(below, 2, (40, 40, 28))}
    filled = fill_organs(boxes, SETTINGS, frames)
    assert set(filled.group_names) == {"cut_short", "cut_long", "wall_short", "wall_long"}
    for name, z in (("short", -4), ("long", 4)):
        faces = filled.group(f"cut_{name}")
        assert filled.vertices[faces][:, :, 2] == pytest.approx(z, abs=SETTINGS.tolerance_mm)
        assert Mesh(filled.vertices, faces).area == pytest.approx(64, rel=0.05)


def test_the_angles_are_fit_for_a_solver(bar):
    _, report = bar
    for organ in report["organs"].values():
        assert organ["least_dihedral_deg"]["min"] > 8
        assert organ["least_dihedral_deg"]["p5"] > 15  # the mesher makes others on another machine
        assert organ["radius_ratio"]["median"] > 0.5
    assert report["warnings"] == []


def test_edges_follow_curvature_and_the_number():
    """A ball of a third of the radius has shorter edges; where neither curves, the number rules."""
    balls = {"large": sphere(9.0, subdivisions=3), "small": sphere(3.0, (16.0, 0, 0), subdivisions=3)}
    filled = fill_organs(balls, SETTINGS.model_copy(update={"edge_mm": 12.0, "tolerance_mm": 0.15}))
    assert filled.group_names == ("wall_large", "wall_small")
    large, small = (
        Mesh(filled.vertices, filled.group(name)).dihedrals.lengths.mean() for name in filled.group_names
    )
    assert small < 0.8 * large
    assert large < 12


def test_a_flat_and_a_regular_tetrahedron():
    regular = np.array([(1.0, 1, 1), (-1, -1, 1), (-1, 1, -1), (1, -1, -1)])
    corner = np.array([(0.0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)])
    flat = np.array([(0.0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 1e-9)])
    corners = np.stack([regular, corner, flat])
    assert np.sort(dihedral_angles(corners)[1]) == pytest.approx([54.7356] * 3 + [90] * 3, abs=1e-3)
    # r = 1 / (3 + sqrt 3) and R = sqrt 3 / 2
    assert radius_ratios(corners) == pytest.approx([1, 3 / (3 + 3**0.5) * 2 / 3**0.5, 0], abs=1e-6)


def test_what_falls_short_is_said():
    poor = {"least_dihedral_deg": {"min": 1.0}, "volume_ratio": 0.9}
    good = {"least_dihedral_deg": {"min": 10.0}, "volume_ratio": 1.0}
    found = warnings_of({"organs": {"liver": poor, "spleen": good}})
    assert len(found) == 2
    assert all("liver" in line and "surface.tetrahedra." in line for line in found)


def test_chords_are_balanced_and_what_is_fixed_stays():
    ball, inscribed = sphere(10.0, subdivisions=4), sphere(10.0, subdivisions=1)
    vertices = np.vstack([inscribed.vertices, np.zeros(3)])
    tetrahedra = np.column_stack([inscribed.faces, np.full(len(inscribed.faces), len(vertices) - 1)])
    tetrahedra = tetrahedra[:, (0, 2, 1, 3)] if signed_volumes(vertices[tetrahedra]).min() < 0 else tetrahedra
    fixed = np.zeros(len(vertices), bool)
    moved = balance_chords(vertices, tetrahedra, inscribed.faces, ball, fixed)
    assert inscribed.volume < 0.9 * ball.volume
    assert np.abs(signed_volumes(moved[tetrahedra])).sum() == pytest.approx(ball.volume, rel=0.02)
    assert np.array_equal(balance_chords(vertices, tetrahedra, inscribed.faces, ball, ~fixed), vertices)


def test_no_vertex_leaves_the_scan():
    """A roof in a box: no face lies along the end of the scan, where the ridge is, and all are far inside."""
    roof = np.array([(-5.0, -5, -5), (5, -5, -5), (-5, 5, -5), (5, 5, -5), (0, -5, 5), (0, 5, 5)])
    tetrahedra = np.array([(0, 4, 1, 5), (0, 1, 3, 5), (0, 3, 2, 5)])
    regions, inside, organs = np.zeros(3, np.int64), np.ones((3, 1), bool), {"box": box((10, 10, 10))}
    scan = Frame(np.array([[1.0, 0, 0, -10], [0, 1, 0, -10], [0, 0, 1, -7.5], [0, 0, 0, 1]]), 2, (20, 20, 13))
    alone = _bounded(roof, tetrahedra, regions, inside, organs, {}, quadratic=False)
    in_scan = _bounded(roof, tetrahedra, regions, inside, organs, {"box": scan}, quadratic=False)
    assert alone.vertices[4:, 2].min() > 6
    assert in_scan.vertices[4:, 2].tolist() == [5, 5]


@pytest.mark.parametrize("key", ["edge_mm", "tolerance_mm"])
def test_sizes_that_nobody_could_wait_for_are_refused_at_once(key):
    with pytest.raises(InputError, match=f"surface.tetrahedra.{key}: 1e-05 mm asks for about .* raise it"):
        fill_organs({"ball": sphere(50.0)}, SETTINGS.model_copy(update={key: 1e-5}))


def test_an_open_surface_is_refused():
    ball = sphere(5.0)
    assert "not closed" in refusal(fill_organs, {"open": Mesh(ball.vertices, ball.faces[1:])}, SETTINGS)


def test_the_filling_ends_with_a_killed_parent():
    wait = f"import sys; sys.path[:] = {sys.path}; from cccd_tetrahedra.own_process import call, signal; "
    parent = subprocess.Popen([sys.executable, "-c", f"{wait}call(signal.pause)"])
    while not (children := psutil.Process(parent.pid).children()):
        time.sleep(0.1)
    parent.kill()
    assert psutil.wait_procs(children, timeout=10)[1] == []


GMSH = """
import json, sys, gmsh
gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
gmsh.open(sys.argv[1])
groups = {}
for dimension, tag in gmsh.model.getPhysicalGroups():
    count = 0
    for entity in gmsh.model.getEntitiesForPhysicalGroup(dimension, tag):
        count += sum(map(len, gmsh.model.mesh.getElements(dimension, entity)[1]))
    groups[gmsh.model.getPhysicalName(dimension, tag)] = [dimension, count]
tags = gmsh.model.mesh.getElementsByType(4)[0]
print("FOUND", json.dumps([groups, min(gmsh.model.mesh.getElementQualities(tags, "volume"))]))
"""


def test_gmsh_reads_regions_and_boundaries(bar, tmp_path):
    if subprocess.run([sys.executable, "-c", "import gmsh"], capture_output=True).returncode:
        pytest.skip("gmsh does not run here (pip install gmsh, libglu1-mesa)")
    filled, report = bar
    WRITERS["msh"](tmp_path / "bar.msh", filled)
    done = subprocess.run(
        [sys.executable, "-c", GMSH, str(tmp_path / "bar.msh")], capture_output=True, text=True, check=True
    )
    groups, least = json.loads(done.stdout.split("FOUND")[1])
    expected = {name: [2, count] for name, count in report["groups"].items()}
    expected |= {name: [3, organ["tetrahedra"]] for name, organ in report["organs"].items()}
    assert groups == expected
    assert least > 0


def test_vtk_reads_regions_and_boundaries(bar, tmp_path):
    filled, report = bar
    WRITERS["vtu"](tmp_path / "bar.vtu", filled)
    grid = pyvista.read(tmp_path / "bar.vtu")
    assert list(grid.field_data["region_names"]) == ["left", "right", "tumour"]
    counts = np.bincount(grid.cell_data["region"])[1:].tolist()
    assert counts == [organ["tetrahedra"] for organ in report["organs"].values()]
    assert grid.compute_cell_sizes()["Volume"].sum() == pytest.approx(filled.volumes.sum())


@needs_calculix
def test_calculix_presses_on_a_boundary(bar, tmp_path):
    """Without lateral strain, pressure on one end shortens the bar by p L / E."""
    filled, _ = bar
    WRITERS["inp"](tmp_path / "bar.inp", filled)
    modulus, pressure = 2.0, 0.01
    held, tissue = "N_CUT_LEFT, 1, 3", elastic(modulus, 0.0)
    moved = calculix(tmp_path, "bar.inp", held, "CUT_RIGHT", pressure, tissue)[:, 1:]
    assert len(moved) == len(np.unique(filled.group("cut_right")))
    shortened = -pressure * 2 * HALF / modulus
    assert moved[:, 2].mean() == pytest.approx(shortened, rel=0.02)
    # The mesher may move an edge of the end by its tolerance: the pressure then lies off the axis by up to
    # half of that, and the bar bends (6 times the offset by the width, at the end's edges).
    bent = 6 * SETTINGS.tolerance_mm / 2 / WIDTH
    assert moved[:, 2] == pytest.approx(shortened, rel=bent)


def test_a_surface_is_filled_once_for_all_formats(tmp_path):
    import pyvista

    at = np.linalg.norm(np.indices((16, 16, 16)) - 7.5, axis=0)
    surface = cccd.reconstruct(at <= 6)
    coarse = cccd.Settings(surface={"tetrahedra": {"edge_mm": 6, "tolerance_mm": 0.4}})
    for name in ("a.msh", "a.vtu", "a.inp"):
        surface.write(tmp_path / name, settings=coarse)
    (report,) = surface.tetrahedra
    grid = pyvista.read(tmp_path / "a.vtu")
    solid = grid.extract_cells(grid.celltypes == pyvista.CellType.TETRA)
    assert solid.n_cells == report["tetrahedra"]
    lines = (tmp_path / "a.msh").read_text().splitlines()
    nodes = lines[lines.index("$Nodes") + 2 : lines.index("$EndNodes")]
    written = np.array([line.split()[1:] for line in nodes], float)
    np.testing.assert_allclose(written, grid.points, atol=1e-4)
