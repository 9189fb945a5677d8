"""Shapes whose distance, overlap and volumes are known measure as they are, in whatever form they come."""

import json

import nibabel
import numpy as np
import pytest
import pyvista
import trimesh
from support.refusals import refusal
from support.solids import mesh_of

import cccd
from cccd.cli import main
from cccd.errors import InputError
from cccd.geometry.mesh import Mesh
from cccd_meshes.read_meshes import read_mesh
from cccd_workflow.comparison import compare, missed_limits
from cccd_workflow.surface_measures import measure_agreement, surface_distances

AFFINE = np.array([[0.8, 0, 0, -12], [0, -0.8, 0, 14], [0, 0, 1.5, -16], [0, 0, 0, 1.0]])
SHAPE = (32, 34, 22)


def ball(radius, centre=(0, 0, 0)):
    index = np.moveaxis(np.indices(SHAPE), 0, -1)
    world = index @ AFFINE[:3, :3].T + AFFINE[:3, 3]
    return np.linalg.norm(world - centre, axis=-1) <= radius


def sphere(radius, centre=(0, 0, 0)):
    mesh = trimesh.creation.icosphere(4, radius)
    mesh.apply_translation(centre)
    return mesh


def save(path, data, affine=AFFINE):
    nibabel.save(nibabel.Nifti1Image(data.astype(np.uint8), affine), path)


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    sphere(10).export("ten.ply")
    sphere(9).export("nine.stl")
    labels = 5 * ball(7).astype(np.uint8)
    labels[:4, :4, :4] = 2
    moved = np.roll(labels, 1, axis=0)
    moved[moved == 2] = 3
    save("labels.nii.gz", labels)
    save("moved.nii.gz", moved)
    save("seven.nii.gz", ball(7))
    return tmp_path


def test_concentric_spheres_have_the_figures_of_formulas(here):
    (row,) = compare("ten.ply", "nine.stl", tolerance_mm=0.5).rows
    figures = row.figures
    assert figures["dice"] == pytest.approx(2 * 9**3 / (9**3 + 10**3), abs=2e-4)
    for name in ("assd_mm", "hd95_mm", "hausdorff_mm"):
        assert figures[name] == pytest.approx(1, abs=0.02)
    assert figures["surface_dice"] == 0
    assert figures["volume_a_ml"] == pytest.approx(sphere(10).volume / 1000)
    assert figures["volume_bias"] == pytest.approx(10**3 / 9**3 - 1, rel=1e-3)
    assert figures["normals_median_deg"] < 2
    (near,) = compare("ten.ply", "nine.stl", tolerance_mm=1.1).rows
    assert near.figures["surface_dice"] == 1


def test_the_hausdorff_distance_finds_a_lone_tip():
    smooth = mesh_of(sphere(10))
    vertices = smooth.vertices.copy()
    vertices[0] *= 1.5
    found = surface_distances(Mesh(vertices, smooth.faces), smooth, np.random.default_rng(0), 2000)
    assert found["hausdorff"] == pytest.approx(5, abs=0.05)


def test_a_surface_and_its_mask_have_the_report_s_figures(here):
    assert main(["surface", "seven.nii.gz"]) == 0
    (row,) = compare("seven.ply", "seven.nii.gz").rows
    reported = measure_agreement(read_mesh("seven.ply").mesh, cccd.read("seven.nii.gz"))
    assert row.figures["dice"] == reported["dice_3d"]
    for name in ("assd_mm", "hd95_mm", "hausdorff_mm", "volume_bias"):
        assert row.figures[name] == pytest.approx(reported[name], rel=1e-9)


def test_masks_overlap_voxel_by_voxel_also_on_turned_and_cropped_grids(here):
    expected = 2 * (ball(7) & ball(6)).sum() / (ball(7).sum() + ball(6).sum())
    cut = ball(6)[2:, ::-1, 1:]
    affine = AFFINE @ np.array([[1, 0, 0, 2], [0, -1, 0, SHAPE[1] - 1], [0, 0, 1, 1], [0, 0, 0, 1.0]])
    save("six.nii.gz", cut, affine)
    (row,) = compare("seven.nii.gz", "six.nii.gz").rows
    assert row.figures["dice"] == expected
    assert row.figures["volume_b_ml"] == pytest.approx(ball(6).sum() * 0.96 / 1000)


def test_label_maps_have_a_row_for_each_label(here):
    rows = {row.label: row for row in compare("labels.nii.gz", "moved.nii.gz").rows}
    assert set(rows) == {"5", "2", "3"}
    labels = 5 * ball(7)
    shared = (labels == 5) & (np.roll(labels, 1, axis=0) == 5)
    assert rows["5"].figures["dice"] == shared.sum() / ball(7).sum()
    assert rows["5"].figures["volume_bias"] == 0
    for label, side in (("2", "first"), ("3", "second")):
        assert rows[label].figures["dice"] == 0
        assert rows[label].figures["assd_mm"] is None
        assert rows[label].notes == (f"only the {side} input has it",)
    (one,) = compare("labels.nii.gz", "moved.nii.gz", ["5"]).rows
    assert one.figures == pytest.approx(rows["5"].figures)
    assert main(["surface", "labels.nii.gz", "--label", "5", "-o", "five.ply"]) == 0
    (meshed,) = compare("five.ply", "labels.nii.gz", ["5"]).rows
    assert meshed.label == "5"
    (two,) = compare("labels.nii.gz", "moved.nii.gz", ["2", "3"]).rows
    assert two.figures["dice"] > 0.5


def test_a_mask_with_another_value_is_still_the_one_organ(here):
    save("other.nii.gz", 9 * ball(7))
    (row,) = (found := compare("seven.nii.gz", "other.nii.gz")).rows
    assert row.figures["dice"] == 1
    assert repr(found) == str(found)


def test_an_open_mesh_has_distances_alone(here):
    mesh = sphere(10)
    trimesh.Trimesh(mesh.vertices, mesh.faces[:-1000], process=False).export("open.ply")
    (row,) = compare("open.ply", "ten.ply").rows
    assert row.figures["dice"] is None
    assert row.figures["volume_a_ml"] is None
    assert row.figures["assd_mm"] < 0.2
    assert "open" in row.notes[0]


def test_turned_triangles_are_mended_and_noted(here):
    mesh = sphere(10)
    faces = np.array(mesh.faces)
    faces[::9] = faces[::9, ::-1]
    trimesh.Trimesh(mesh.vertices, faces, process=False).export("turned.ply")
    found = compare("turned.ply", "ten.ply")
    assert found.rows[0].figures["dice"] == pytest.approx(1)
    assert "turned round" in found.notes[0]


def test_reversed_axes_are_noticed(here):
    sphere(5, (30, 40, 0)).export("ras.ply")
    sphere(5, (-30, -40, 0)).export("lps.ply")
    (row,) = compare("ras.ply", "lps.ply").rows
    assert row.figures["dice"] == 0
    assert "LPS" in row.notes[0]


def test_limits_set_the_exit_status(here, capsys):
    assert main(["compare", "ten.ply", "nine.stl", "--min-dice", "0.8", "--max-hd95", "1.5"]) == 0
    assert main(["compare", "ten.ply", "nine.stl", "--min-dice", "0.9", "--max-hd95", "0.5"]) == 1
    said = capsys.readouterr().out
    assert "Dice 0.84" in said
    assert "HD95" in said
    assert main(["compare", "ten.ply", "nine.stl", "--json", "--max-volume-bias", "0.1"]) == 1
    found = json.loads(capsys.readouterr().out)
    assert found["rows"][0]["dice"] == pytest.approx(0.8433, abs=1e-3)
    assert len(found["missed"]) == 1
    assert main(["compare", "nine.stl", "ten.ply", "--max-volume-bias", "0.1"]) == 1  # below counts as well


def test_missing_figures_miss_their_limits(here):
    found = compare("labels.nii.gz", "moved.nii.gz")
    missed = missed_limits(found, {"hd95_mm": 5.0})
    assert [line.split(":")[0] for line in missed] == ["2", "3"]


def test_heat_maps_hold_the_distance(here):
    assert (
        main(["compare", "ten.ply", "nine.stl", "-o", "heat.vtp", "-o", "heat.glb", "-o", "heat.html"]) == 0
    )
    drawn = pyvista.read("heat.vtp")
    assert drawn.point_data["distance"] == pytest.approx(np.ones(drawn.n_points), abs=0.02)
    assert main(["compare", "nine.stl", "ten.ply", "-o", "inside.vtp"]) == 0
    assert pyvista.read("inside.vtp").point_data["distance"].max() < 0
    scene = trimesh.load("heat.glb", process=False)
    (geometry,) = scene.geometry.values()
    red, _, blue = np.asarray(geometry.visual.vertex_colors)[:, :3].T
    assert (red > blue).all()  # outside
    assert read_mesh("heat.glb").mesh.volume == pytest.approx(read_mesh("ten.ply").mesh.volume, rel=1e-5)
    page = (here / "heat.html").read_text()
    assert "ten.ply" in page
    assert "http" not in page.split("<body>")[0].replace("http-equiv", "")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["ten.ply", "absent.stl"], "absent.stl"),
        (["ten.ply", "labels.nii.gz"], "--label"),
        (["labels.nii.gz", "moved.nii.gz", "--label", "4"], "4"),
        (["ten.ply", "nine.stl", "-o", "heat.doc"], "heat.doc"),
        (["ten.ply", "nine.stl", "-o", "ten.ply"], "ten.ply"),
        (["ten.ply", "nine.stl", "--tolerance", "-1"], "--tolerance"),
    ],
)
def test_bad_input_is_one_line(here, refused, arguments, said):
    before = (here / "ten.ply").read_bytes()
    assert said in refused("compare", *arguments)
    assert (here / "ten.ply").read_bytes() == before


def test_label_maps_with_nothing_in_common_are_refused(here):
    save("far.nii.gz", 8 * ball(5) + 1 * ball(2))
    assert "no label in common" in refusal(compare, "labels.nii.gz", "far.nii.gz")
    with pytest.raises(InputError, match="Nifti1Image is no path or Surface"):
        compare(nibabel.load("labels.nii.gz"), "far.nii.gz")
