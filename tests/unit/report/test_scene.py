"""What the page's views are given lies where the organ lies."""

import base64
import io

import numpy as np
import pytest
import shapely
from PIL import Image
from sample_results import BAND, BOUNDARIES, write_results, write_sample_view
from test_payload import unpack

from cccd.boundary import extract_boundaries
from cccd.containers import Curves, Frame, Structure
from cccd.curves import describe_curves
from cccd.geometry.distance import to_mesh
from cccd.geometry.ply import read_ply
from cccd.report.results import StructureFiles
from cccd.report.scene import _display, _letters, _round_up, build_scene, colour_stops
from cccd.settings.curves import CurveSettings
from cccd.store import read_curves, write_boundaries, write_curves, write_structure


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    root = tmp_path_factory.mktemp("results") / "phantom" / "liver"
    write_results(root, "phantom", "liver")
    return root


def scene_of(folder, triangles):
    write_sample_view(folder, triangles)
    return build_scene(StructureFiles(folder))


def test_meshes_and_net_share_the_world(folder):
    scene = scene_of(folder, 4000)
    assert scene.parts == {"surface", "cubes", "net", "curves", "slices"}
    meta, arrays = unpack(scene.data)
    world = {
        name: np.asarray(meta[grid]["origin"]) + meta[grid]["step"] * arrays[f"{name}_points"]
        for name, grid in (("surface", "mm"), ("cubes", "mm"), ("net", "net_mm"))
    }
    centres = {name: (points.min(axis=0) + points.max(axis=0)) / 2 for name, points in world.items()}
    np.testing.assert_allclose(centres["cubes"], centres["surface"], atol=0.5)
    np.testing.assert_allclose(centres["net"], centres["surface"], atol=0.01)
    pixels = np.asarray(meta["pixels"]["origin"]) + meta["pixels"]["step"] * arrays["curve_points"]
    k = np.repeat(arrays["curve_slice"].ravel(), np.diff(arrays["curve_offsets"].ravel()))
    curve = np.column_stack([pixels, k, np.ones(len(k))]) @ np.array(meta["stack_affine"]).T
    np.testing.assert_allclose(
        (curve[:, :3].min(axis=0) + curve[:, :3].max(axis=0)) / 2, centres["surface"], atol=0.5
    )
    assert len(arrays["surface_faces"]) <= 4000
    assert any("Simplified" in note for note in scene.notes)


def test_long_curves_are_drawn_without_crossings(tmp_path):
    """A band of three pixels wound eight times: a few points for all of it would draw lines across."""
    folder = tmp_path / "phantom" / "liver"
    write_results(folder, "phantom", "liver")
    turn = np.linspace(0, 1, 4000)
    out = np.column_stack([np.cos(16 * np.pi * turn), np.sin(16 * np.pi * turn)])
    middle = (40 + 150 * turn)[:, None]
    band = 300 + np.concatenate([(middle + 1.5) * out, ((middle - 1.5) * out)[::-1]])
    one = read_curves(folder / "curves.h5")
    curves = Curves(band, np.array([0, len(band)]), one.slice[:1], np.zeros(1, bool), one.frame)
    write_curves(folder / "curves.h5", describe_curves(curves, CurveSettings()))
    _, arrays = unpack(scene_of(folder, 4000).data)
    assert shapely.LinearRing(arrays["curve_points"].astype(float)).is_simple


def test_distance_colours_are_small_for_the_true_surface(folder):
    scene = scene_of(folder, 20_000)
    _, arrays = unpack(scene.data)
    legend = next(one for one in scene.legends if one.name == "distance")
    distance = (arrays["surface_distance"].astype(float) / 127.5 - 1) * legend.limit
    assert abs(np.median(distance)) < 0.5  # mm, voxels are 1 x 1 x 2
    assert legend.unit == "mm"


def test_the_bands_lines_lie_as_far_from_the_surface_as_the_band_says(folder):
    meta, arrays = unpack(scene_of(folder, 20_000).data)
    surface = read_ply(folder / "surface.ply")
    drawn = set(read_curves(folder / "curves.h5").slice.tolist())
    for side, sign in (("inner", -1), ("outer", 1)):
        pixels = np.asarray(meta["pixels"]["origin"]) + meta["pixels"]["step"] * arrays[f"{side}_points"]
        k = np.repeat(arrays[f"{side}_slice"].ravel(), np.diff(arrays[f"{side}_offsets"].ravel()))
        points = np.column_stack([pixels, k, np.ones(len(k))]) @ np.array(meta["stack_affine"]).T
        away = to_mesh(points[:, :3], surface)
        np.testing.assert_allclose(away, sign * BAND[side], atol=0.06)  # mm; the sphere has 5000 triangles
        middle = {k for k in drawn if min(drawn) + 2 < k < max(drawn) - 2}
        assert middle <= set(k.tolist()) <= drawn
    legend = next(one for one in build_scene(StructureFiles(folder)).legends if one.name == "band")
    widths = legend.least + arrays["surface_band"] / 255 * (legend.limit - legend.least)
    np.testing.assert_allclose(widths, sum(BAND.values()), atol=0.02)


def test_overlays_are_counted_per_slice(folder):
    _, arrays = unpack(scene_of(folder, 2000).data)
    offsets = arrays["boundary_offsets"].ravel().astype(int)
    assert offsets[-1] == len(arrays["boundary_points"])
    assert (np.diff(offsets) > 0).all()
    dropped, bridged = (arrays[f"{name}_offsets"].ravel()[-1] for name in ("dropped", "bridged"))
    assert dropped == bridged == 0  # a traced mask's pixels are its curves


def test_sprite_shows_the_organ_where_the_boundary_is(folder):
    scene = scene_of(folder, 2000)
    meta, arrays = unpack(scene.data)
    layout = meta["slices"]
    tile = layout["tile"]
    sheet = np.asarray(Image.open(io.BytesIO(base64.b64decode(scene.sprite))).convert("L")).astype(float)
    index = len(layout["k"]) // 2
    row, column = divmod(index, tile["columns"])
    here = sheet[row * tile["height"] :, column * tile["width"] :][: tile["height"], : tile["width"]]
    part = slice(*arrays["boundary_offsets"].ravel()[index : index + 2].astype(int))
    points = np.asarray(meta["pixels"]["origin"]) + meta["pixels"]["step"] * arrays["boundary_points"][part]
    x, y = np.array(layout["to_picture"]) @ np.column_stack([points, np.ones(len(points))]).T
    inside = np.zeros(here.shape, bool)
    inside[int(y.min()) + 8 : int(y.max()) - 8, int(x.min()) + 8 : int(x.max()) - 8] = True
    outside = np.ones(here.shape, bool)
    outside[int(y.min()) - 2 : int(y.max()) + 3, int(x.min()) - 2 : int(x.max()) + 3] = False
    assert here[inside].mean() - here[outside].mean() > 80


def test_boundary_alone_makes_a_scene_without_a_mask(tmp_path):
    mask = np.zeros((30, 30, 4), bool)
    mask[5:22, 8:25, 1:3] = True
    frame = Frame(np.diag([1.0, 1.0, 3.0, 1.0]), 2, mask.shape)
    whole = Structure("a", "b", frame, np.zeros(3, int), mask=mask)
    boundaries = extract_boundaries(whole, BOUNDARIES)
    rings = np.zeros_like(mask)
    for k, part in zip(boundaries.slice, boundaries, strict=True):
        rings[part[:, 0], part[:, 1], k] = True
    write_structure(tmp_path / "structure.h5", Structure("a", "b", frame, np.zeros(3, int), boundary=rings))
    write_boundaries(tmp_path / "boundaries.h5", boundaries)
    scene = build_scene(StructureFiles(tmp_path))
    assert scene.parts == {"slices"}
    assert scene.sprite is None


def test_empty_folder_has_no_scene(tmp_path):
    assert build_scene(StructureFiles(tmp_path)) is None


AXES = {
    "LPS axial": (np.diag([-1.0, -1, 1, 1]), 2, "RLAP"),
    "RAS axial": (np.diag([1.0, 1, 1, 1]), 2, "RLAP"),
    "RAS coronal": (np.diag([1.0, 1, 1, 1]), 1, "RLSI"),
    "RAS sagittal": (np.diag([1.0, 1, 1, 1]), 0, "APSI"),
}


@pytest.mark.parametrize("name", AXES)
def test_slices_lie_as_a_radiologist_reads_them(name):
    affine, axis, letters = AXES[name]
    frame = Frame(affine, axis, (40, 50, 60))
    picture, right, down = _display(frame, np.array([3, 5]), np.array([20, 30]))
    sides = _letters(right, down)
    assert "".join(sides[side] for side in ("left", "right", "top", "bottom")) == letters
    # every corner of the window falls on a corner of the picture
    corners = np.array([[3, 5, 1], [20, 5, 1], [3, 30, 1], [20, 30, 1.0]])
    x, y = np.array(picture["to_picture"]) @ corners.T
    assert set(x) == {0, picture["width"] - 1}
    assert set(y) == {0, picture["height"] - 1}


def test_transposed_slices_keep_their_aspect():
    affine = np.zeros((4, 4))
    affine[1, 0], affine[0, 1], affine[2, 2], affine[3, 3] = 0.5, 2.0, 3.0, 1.0  # i runs along y, j along x
    picture, _, _ = _display(Frame(affine, 2, (9, 9, 9)), np.array([0, 0]), np.array([9, 4]))
    assert (picture["width"], picture["height"]) == (5, 10)
    assert picture["aspect"] == pytest.approx(0.25)


@pytest.mark.parametrize(
    ("value", "limit"), [(0.0011, 0.0015), (1.0, 1.0), (4.2, 5.0), (71, 100.0), (0, 1.0)]
)
def test_legends_end_at_round_numbers(value, limit):
    assert _round_up(value) == pytest.approx(limit)


def test_colour_scales_are_light_in_the_middle_and_the_bands_at_its_least():
    for name, stops in colour_stops().items():
        sums = np.sum(stops, axis=1)
        if name == "band":
            assert np.all(np.diff(sums[::8]) < 0)
            continue
        assert sums[len(sums) // 2] > 690
        assert sums[0] < 330
        assert sums[-1] < 330
