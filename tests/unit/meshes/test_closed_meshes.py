"""Meshes of others become organs: closed, smooth, in their place. What is mended is reported."""

import nibabel
import numpy as np
import pytest
import trimesh
from support import scans
from support.solids import box, egg, mesh_of

import cccd
from cccd.cli import main
from cccd.errors import InputError
from cccd.geometry.mesh import Mesh
from cccd_meshes import closed_meshes
from cccd_meshes.closed_meshes import mend
from cccd_meshes.distance_grid import grid_to_mesh
from cccd_workflow.surface_measures import surface_distances

AFFINE = np.array([[-1.0, 0, 0, 40], [0, -1.0, 0, 35], [0, 0, 2.5, -45], [0, 0, 0, 1]])
SHAPE = (80, 70, 36)


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    egg().export("egg.stl")
    nibabel.save(nibabel.Nifti1Image(np.zeros(SHAPE, np.int16), AFFINE), "scan.nii.gz")
    return tmp_path


def test_a_mesh_becomes_a_smooth_spline_near_to_it(here):
    surface = cccd.smooth_mesh("egg.stl")
    assert len(surface.bodies) == 1
    assert surface.warnings == ()
    assert surface.volume == pytest.approx(egg().volume, rel=2e-3)
    found = surface_distances(surface.lofted.mesh, mesh_of(egg()), np.random.default_rng(0), 5000)
    assert found["assd"] < 0.05
    assert found["hausdorff"] < 0.4


def test_a_torus_keeps_its_hole_and_a_shell_its_cavity(here):
    trimesh.creation.torus(20, 7).export("ring.ply")
    surface = cccd.smooth_mesh("ring.ply")
    assert surface.lofted.mesh.genus == 1
    assert surface.volume == pytest.approx(trimesh.creation.torus(20, 7).volume, rel=5e-3)
    inner = trimesh.creation.icosphere(4, 8)
    inner.invert()
    trimesh.util.concatenate([trimesh.creation.icosphere(4, 16), inner]).export("shell.obj")
    shell = cccd.smooth_mesh("shell.obj")
    assert shell.volume == pytest.approx(4 / 3 * np.pi * (16**3 - 8**3), rel=1e-2)
    assert sorted(body.sign for body in shell.bodies) == [-1, 1]


def test_a_mesh_on_a_scan_s_grid_is_the_voxels_inside_it(here):
    assert main(["surface", "egg.stl", "--like", "scan.nii.gz", "-o", "mask.nii.gz"]) == 0
    written = nibabel.load("mask.nii.gz")
    np.testing.assert_allclose(written.affine, AFFINE)
    world = np.moveaxis(np.indices(SHAPE), 0, -1) @ AFFINE[:3, :3].T + AFFINE[:3, 3]
    radius = np.linalg.norm(world / (20, 16, 26), axis=-1)
    mask = np.asarray(written.dataobj) > 0
    clear = np.abs(radius - 1) > 0.005  # the icosphere's facets lie within
    np.testing.assert_array_equal(mask[clear], radius[clear] < 1)


def test_a_mesh_on_a_series_becomes_seg_and_rtstruct(here):
    scans.write_series(here / "ct", np.zeros(SHAPE, np.int16), AFFINE)
    outputs = ["-o", "egg.seg.dcm", "-o", "egg.dcm"]
    assert main(["surface", "egg.stl", "--like", "ct", *outputs]) == 0
    for name in ("egg.seg.dcm", "egg.dcm"):
        structure = cccd.read(name, image="ct")
        assert cccd.reconstruct(structure).volume == pytest.approx(egg().volume, rel=0.01)


def test_a_mesh_becomes_a_step_solid_and_comes_back(here, answer):
    pytest.importorskip("OCP")
    made = answer("surface", "egg.stl", "-o", "egg.step")["surfaces"][0]
    assert made["volume_ml"] == pytest.approx(egg().volume / 1000, rel=2e-3)
    again = cccd.smooth_mesh("egg.step")
    assert again.volume == pytest.approx(egg().volume, rel=4e-3)


def test_what_is_mended_is_said():
    solid = egg()
    faces = np.array(solid.faces)
    pricked = mend(Mesh(np.array(solid.vertices), faces[1:]), "egg")
    assert pricked.mesh.is_closed_manifold
    assert "hole" in pricked.notes[0]
    turned = faces.copy()
    turned[::7] = turned[::7, ::-1]
    alike = mend(Mesh(np.array(solid.vertices), turned), "egg")
    assert alike.mesh.is_closed_manifold
    assert alike.mesh.volume == pytest.approx(solid.volume)
    assert "turned round" in alike.notes[0]
    inside_out = mend(mesh_of(solid).reversed(), "egg")
    assert inside_out.mesh.volume == pytest.approx(solid.volume)
    assert "inwards" in inside_out.notes[0]
    doubled = mend(Mesh(np.array(solid.vertices), np.vstack([faces, faces[:5]])), "egg")
    assert doubled.mesh.is_closed_manifold
    assert "twice" in doubled.notes[0]
    sound = mend(mesh_of(solid), "egg")
    assert sound.notes == ()


def test_pieces_that_pass_through_each_other_are_united():
    first, second = trimesh.creation.box((10, 10, 10)), trimesh.creation.box((10, 10, 10))
    second.apply_translation((5, 1, 1))
    both = mend(mesh_of(trimesh.util.concatenate([first, second])), "boxes")
    assert both.mesh.volume == pytest.approx(2000 - 5 * 9 * 9)
    assert "united" in both.notes[0]
    assert len(both.mesh.self_intersections()) == 0


def test_a_mesh_that_passes_through_itself_is_made_again(monkeypatch):
    monkeypatch.setattr(closed_meshes, "REMESHED", 100)
    solid = trimesh.creation.cylinder(4, 60, sections=48)
    solid = solid.subdivide_to_size(3)
    angle = solid.vertices[:, 2] / 60 * 2.6 * np.pi  # bent into more than a whole turn, a little aside
    radius = 14 + solid.vertices[:, 0]
    bent = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), solid.vertices[:, 1] + angle])
    merged = trimesh.Trimesh(bent, solid.faces, process=True)
    mesh = mesh_of(merged)
    assert len(mesh.self_intersections()) > 0
    found = mend(mesh, "bent")
    assert found.mesh.is_closed_manifold
    assert len(found.mesh.self_intersections()) == 0
    assert "made again" in found.notes[-1]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["open.ply"], "open"),
        (["egg.stl", "-o", "mask.nii.gz"], "--like"),
        (["egg.stl", "--like", "absent.nii.gz", "-o", "mask.nii.gz"], "absent.nii.gz"),
        (["far.ply", "--like", "scan.nii.gz", "-o", "mask.nii.gz"], "outside scan.nii.gz"),
        (["lps.ply", "--like", "scan.nii.gz", "-o", "mask.nii.gz"], "LPS"),
        (["egg.stl", "--label", "5"], "egg.stl"),
        (["scan.nii.gz", "--like", "scan.nii.gz"], "--like"),
        (["egg.stl", "-o", "egg.stl"], "egg.stl"),
    ],
)
def test_bad_input_is_one_line(here, refused, arguments, said):
    solid = egg()
    trimesh.Trimesh(solid.vertices, solid.faces[: len(solid.faces) // 2], process=False).export("open.ply")
    for name, move in {"far": (500, 0, 0), "lps": (-15, 90, 0)}.items():
        solid = egg()
        solid.apply_translation(move)
        solid.export(f"{name}.ply")
    moved = AFFINE.copy()
    moved[1, 3] -= 80
    if "lps.ply" in arguments:
        nibabel.save(nibabel.Nifti1Image(np.zeros(SHAPE, np.int16), moved), "scan.nii.gz")
    assert said in refused("surface", *arguments)
    assert not list(here.glob("mask*"))


def test_an_open_mesh_names_its_holes():
    solid = egg()
    with pytest.raises(InputError, match=r"egg: the mesh is open: 1 hole, the widest \d+"):
        mend(
            Mesh(np.array(solid.vertices), np.array(solid.faces)[np.array(solid.triangles_center)[:, 2] < 5]),
            "egg",
        )


def test_distance_on_a_grid_is_that_of_the_box_within_the_band():
    mesh, half = box((4.0, 6.0, 5.0)), np.array([2.0, 3.0, 2.5])
    low = np.array([-3.37, -4.21, -3.91])
    grid = grid_to_mesh(mesh, low, 0.5, (14, 18, 16), 3.0)
    nodes = low + 0.5 * np.argwhere(np.ones(grid.values.shape))
    beyond = np.abs(nodes) - half
    exact = np.linalg.norm(np.maximum(beyond, 0), axis=1) + np.minimum(beyond.max(axis=1), 0)
    assert grid.values.ravel() == pytest.approx(np.clip(exact, -1.5, 1.5), abs=1e-5)
    again = grid.isosurface(0.0)
    assert again.is_closed_manifold
    assert again.volume == pytest.approx(mesh.volume, rel=0.03)  # the grid cuts edges off
