"""Bands of surfaces whose true surface is known, and what is written of them."""

import json
from pathlib import Path

import nibabel
import numpy as np
import pytest
import pyvista

import cccd
from cccd.bands import (
    SIGNS,
    Band,
    Calibration,
    Reader,
    Slices,
    estimate_band,
    signs_of,
)
from cccd.cli import main
from cccd.errors import InputError
from cccd.files import write_surface
from cccd.geometry.distance import to_mask
from cccd.geometry.mesh import Mesh
from cccd.settings.root import Settings
from cccd.store import write_control_meshes
from cccd.surface.loft import FACTOR
from cccd.surface.surface import read_surface
from cccd_calibration.readers import Pair, calibrate_readers
from cccd_calibration.samples import draw_meshes
from cccd_labels.between import DISTANCES, Between, distance_table, least_distance


def body(axes, spacing):
    """Mask of an ellipsoid around the origin, and its affine."""
    shape = [2 * int(np.ceil(size / step)) + 7 for size, step in zip(axes, spacing, strict=True)]
    affine = np.diag([*spacing, 1.0])
    affine[:3, 3] = -np.array(spacing) * (np.array(shape) - 1) / 2 + np.array([0.2, 0.1, 0.35]) * spacing
    points = np.indices(shape).reshape(3, -1).T * spacing + affine[:3, 3]
    return (np.linalg.norm(points / axes, axis=1) <= 1).reshape(shape), affine


def settings(**surface):
    return Settings(surface=surface)


@pytest.fixture(scope="module", params=[((20, 20, 20), 5), ((28, 16, 24), 8), ((12, 14, 30), 3)])
def ellipsoid(request):
    axes, step = request.param
    return np.array(axes, float), step, cccd.reconstruct(*body(axes, (1, 1, step)))


def offsets(vertices, normals, axes):
    """How far outwards along the normals an ellipsoid with these axes lies."""
    p, n = vertices / axes, normals / axes
    a, b, c = (n * n).sum(1), (p * n).sum(1), (p * p).sum(1) - 1
    root = np.sqrt(np.maximum(b * b - a * c, 0))
    ways = np.stack([(-b - root) / a, (-b + root) / a])
    return ways[np.abs(ways).argmin(axis=0), np.arange(len(p))]


def test_a_band_covers_a_known_surface(ellipsoid):
    axes, step, surface = ellipsoid
    mesh, band = surface.lofted.mesh, surface.lofted.band
    off = offsets(mesh.vertices, mesh.vertex_normals, axes)
    within = (off >= -band.inner) & (off <= band.outer)
    covered = mesh.vertex_areas @ within / mesh.area
    assert covered >= 0.85
    # and is no wider than the slices are apart
    assert (band.inner + band.outer).mean() < step


def test_the_true_volume_lies_in_its_interval(ellipsoid):
    axes, _, surface = ellipsoid
    low, high = surface.volume_interval
    assert low <= 4 / 3 * np.pi * np.prod(axes) <= high
    least, most = surface.intervals["diameter_mm"]
    assert least - 0.5 <= 2 * axes.max() <= most + 0.5
    assert surface.sides["inner"].volume < low < surface.volume < high < surface.sides["outer"].volume


def test_the_band_is_wider_between_slices_than_on_them(ellipsoid):
    _, step, surface = ellipsoid
    mesh, band = surface.lofted.mesh, surface.lofted.band
    index = (mesh.vertices[:, 2] - surface.lofted.frame.affine[2, 3]) / step
    away = np.abs(index - np.rint(index))
    width = band.inner + band.outer
    sloping = np.abs(mesh.vertex_normals[:, 2]) > 0.5
    assert width[sloping & (away > 0.4)].mean() > 1.2 * width[sloping & (away < 0.1)].mean()


def test_a_band_scales_with_the_scan():
    mask, affine = body((14, 14, 14), (1, 1, 4))
    mesh, k = cccd.reconstruct(mask, affine).lofted.mesh, np.flatnonzero(mask.any((0, 1)))
    widths = []
    for times in (1.0, 3.0):
        spacing = np.full(2, times)
        distance = np.stack([to_mask(mask[:, :, one], spacing) for one in k])
        moved = Mesh(times * (mesh.vertices - affine[:3, 3]), mesh.faces)
        slices = Slices(4 * times * k, distance, spacing)
        widths.append(estimate_band(moved, slices, 0.9, Calibration.read()).outer)
    assert np.allclose(widths[1], 3 * widths[0], rtol=1e-3)


def test_a_larger_share_is_a_wider_band():
    mask, affine = body((14, 12, 14), (1, 1, 4))
    made = (cccd.reconstruct(mask, affine, settings=settings(band=share)) for share in (0.5, 0.8, 0.9, 0.95))
    assert np.all(np.diff([surface.lofted.band.outer.mean() for surface in made]) > 0)


def test_slices_unlike_those_of_the_calibration_are_marked():
    mask, affine = body((20, 20, 100), (1, 1, 40))
    surface = cccd.reconstruct(mask, affine)
    assert surface.lofted.band.extrapolated
    assert any("extrapolated" in warning for warning in surface.warnings)


def test_files_carry_the_band(ellipsoid, tmp_path):
    surface = ellipsoid[2].lofted
    write_surface(tmp_path / "surface.ply", surface)
    band = surface.band, surface.vertices
    write_control_meshes(tmp_path / "surface.h5", surface.bodies, surface.frame, surface.report, band)
    back = read_surface(tmp_path / "surface.h5", tmp_path / "surface.ply")
    for side in ("inner", "outer"):
        assert np.allclose(getattr(back.band, side), getattr(surface.band, side), rtol=1e-6)
    write_surface(tmp_path / "surface.vtp", back)
    arrays = pyvista.read(tmp_path / "surface.vtp").point_data
    assert arrays["inner_mm"].min() > 0
    assert arrays["outer_mm"].shape == (len(surface.vertices),)


def test_distance_between_two_organs_has_an_interval():
    one = cccd.reconstruct(*body((10, 10, 10), (1, 1, 3))).lofted
    mask, affine = body((8, 8, 8), (1, 1, 3))
    affine[0, 3] += 25
    between = least_distance(one, cccd.reconstruct(mask, affine).lofted)
    assert between.low_mm < between.mm < between.high_mm
    assert between.low_mm <= 7 <= between.high_mm
    far = Between(40.0, 30.0, 50.0)
    table = distance_table("anna", {("liver", "colon"): far, ("liver", "spleen"): between})
    assert table["other_organ"].tolist() == ["spleen", "colon"]
    assert tuple(table.columns) == DISTANCES


def save(path, mask, affine):
    nibabel.Nifti1Image(mask.astype(np.uint8), affine).to_filename(path)
    return path


def test_the_command_prints_the_interval_and_writes_both_sides(tmp_path, answer, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = save(tmp_path / "ball.nii.gz", *body((12, 12, 12), (1, 1, 3)))
    (made,) = answer("surface", path, "-o", "ball.stl", "--band")["surfaces"]
    assert made["volume_low_ml"] < made["volume_ml"] < made["volume_high_ml"]
    assert (made["band"], made["band_extrapolated"]) == (0.9, False)
    assert made["files"] == ["ball.stl", "ball_inner.stl", "ball_outer.stl"]
    assert all((tmp_path / name).is_file() for name in made["files"])


def test_the_next_slice_is_the_middle_of_the_widest_gap(tmp_path, capsys, refused, answer):
    mask, affine = body((15, 15, 15), (1, 1, 1))
    kept = np.zeros_like(mask)
    kept[:, :, [4, 7, 10, 22, 25, 28]] = mask[:, :, [4, 7, 10, 22, 25, 28]]
    path = save(tmp_path / "drawn.nii.gz", kept, affine)
    slices = answer("next", path, "--annotated", "nonempty")["slices"]
    assert slices[0] == {"slice": 16, "gap": 11}
    assert {one["slice"] for one in slices[1:]} == {5, 8, 23, 26}
    assert main(["next", str(path), "--annotated", "nonempty"]) == 0
    assert "annotate slice 16 next" in capsys.readouterr().out
    assert "no slice is left to draw" in refused("next", save(tmp_path / "ball.nii.gz", mask, affine))


def sheet(folder, count, size=7):
    rows = []
    for number in range(count):
        name = f"ball{number}.nii.gz"
        save(folder / name, *body((size + number % 4, size, size + number % 3), (1, 1, 1)))
        rows.append(f"case{number}\tball\t{name}\n")
    path = folder / "sheet.tsv"
    path.write_text("case\torgan\tmask\n" + "".join(rows))
    return path


def test_too_few_organs_are_refused_before_any_work(tmp_path, refused):
    line = refused("calibrate", sheet(tmp_path, 1), "-o", tmp_path / "own.json")
    assert "1 organ is too few to guarantee 90%" in line
    assert not (tmp_path / "own.json").exists()


def test_own_masks_make_a_calibration_that_is_used(tmp_path, capsys):
    path = tmp_path / "own.json"
    assert main(["calibrate", str(sheet(tmp_path, 9)), "-o", str(path)]) == 0
    assert "9 organs" in capsys.readouterr().out
    assert Calibration.read(path).regimes
    mask, affine = body((10, 9, 10), (1, 1, 3))
    made = (cccd.reconstruct(mask, affine, settings=settings(calibration=one)) for one in (None, str(path)))
    shipped, mine = (surface.lofted.band.outer for surface in made)
    assert np.allclose(mine / shipped, (mine / shipped)[0])
    assert (mine / shipped)[0] != 1


@pytest.mark.parametrize(
    "content", ["{", '{"scale": {}}', '{"scale": "", "made_of": "", "regimes": []}', None]
)
def test_what_is_no_calibration_is_refused(tmp_path, content):
    path = tmp_path / "own.json"
    if content is not None:
        path.write_text(content)
    with pytest.raises(InputError, match="cannot be read" if content is None else "no calibration of this"):
        Calibration.read(path)


def test_shares_that_no_factor_is_kept_for_are_refused():
    with pytest.raises(InputError, match="no factors for a share"):
        Calibration("nothing", {}).factors(3.0, 0.9)


def test_a_band_moves_to_another_mesh():
    band = Band(np.array([1.0, 2.0]), np.array([3.0, 4.0]), 0.9, 1.0, False)
    moved = band.moved_to(np.array([[0.0, 0, 0], [9, 0, 0]]), np.array([[8.0, 0, 0], [1, 0, 0], [9, 1, 0]]))
    assert moved.inner.tolist() == [2, 1, 2]
    assert moved.outer.tolist() == [4, 3, 4]


def test_thickness_is_seen_from_the_slices():
    mask, affine = body(np.array([30.0, 30.0, 5.0]), (1, 1, 1))
    surface, k = cccd.reconstruct(mask, affine).lofted, np.flatnonzero(mask.any((0, 1)))
    distance = np.stack([to_mask(mask[:, :, one], np.ones(2)) for one in k])
    mesh = Mesh(surface.vertices - affine[:3, 3], surface.mesh.faces)
    thick = np.exp(signs_of(mesh, Slices(k.astype(float), distance, np.ones(2)))[:, SIGNS.index("thick")])
    assert np.abs(thick[np.hypot(*surface.vertices[:, :2].T) < 8] - 10).max() < 2


def test_another_readers_border_widens_band_and_interval():
    mask, affine = body((12, 12, 12), (1, 1, 3))
    alone, other = (cccd.reconstruct(mask, affine, settings=settings(reader_mm=mm)) for mm in (None, 1.0))
    width, wider = alone.lofted.band.outer, other.lofted.band.outer
    assert np.allclose(wider**2 - width**2, Reader.of(1.0).at(0.9)[0] ** 2)
    (low, high), (least, most) = alone.volume_interval, other.volume_interval
    assert least < low < high < most


def test_readers_that_differ_by_known_lengths_give_those_lengths(tmp_path):
    rng = np.random.default_rng(0)
    offsets = np.abs(rng.normal(0, 0.5, (40, 7, 999)))
    pairs = [Pair(str(n), of, of[:, 0]) for n, of in enumerate(offsets)]
    reader = calibrate_readers(pairs, 0.9, "pairs.tsv")
    assert reader.at(0.9)[0] == pytest.approx(0.5 * 1.645, rel=0.15)
    reader.write(tmp_path / "readers.json")
    assert Reader.of(str(tmp_path / "readers.json")) == reader


def test_pairs_of_masks_make_a_file_that_is_used(tmp_path, capsys, refused):
    table, out = tmp_path / "pairs.tsv", tmp_path / "readers.json"
    affine, rows = np.eye(4), ["first\tsecond"]
    away = np.linalg.norm(np.indices((20, 20, 20)) - 9.5, axis=0)
    for number in range(10):
        for reader, radius in (("a", 4.5), ("b", 6.5)):
            save(tmp_path / f"{reader}{number}.nii.gz", away <= radius + number / 10, affine)
        rows.append(f"a{number}.nii.gz\tb{number}.nii.gz")
    table.write_text("\n".join(rows) + "\n")
    given = ["calibrate", "--readers", str(table), "-o", str(out)]
    assert main(given) == 0
    assert "10 pairs of readers, 10 organs" in capsys.readouterr().out
    assert 1.9 < Reader.of(str(out)).at(0.9)[0] < 2.3  # ten organs alone tell it with room to spare
    save(tmp_path / "b0.nii.gz", away <= 6, np.diag([1, 1, 2, 1.0]))
    assert "pairs.tsv row 2: a0.nii.gz: the two masks are not on the same grid" in refused(*given)
    save(tmp_path / "b0.nii.gz", away < 0, affine)
    assert "pairs.tsv row 2: b0.nii.gz: the mask is empty" in refused(*given)
    (tmp_path / "b0.nii.gz").unlink()
    assert "pairs.tsv row 2: there is no mask b0.nii.gz" in refused(*given)
    table.write_bytes(b"first\tsecond\n\xff\xfe")
    assert "pairs.tsv: not UTF-8 text" in refused(*given)


#: Widths of a file that are no lengths, or not as many as it has others.
NO_WIDTHS = ("[-1]", "[NaN]", '["a"]', "[1, 2]", "[]", "null")


@pytest.mark.parametrize("given", ["0", "-1", "nan", "gone.json", "1000", "pixels.json", *NO_WIDTHS])
def test_what_no_reader_differs_by_is_refused(given, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("pixels.json").write_text('{"made_of": "", "unit": "pixel", "widths": [1], "swept": [1]}')
    for widths in NO_WIDTHS:
        Path(widths).write_text(f'{{"made_of": "", "unit": "mm", "widths": {widths}, "swept": [1]}}')
    with pytest.raises(InputError, match="in pixel, not in mm" if given == "pixels.json" else None):
        Reader.of(given)


def test_flat_probabilities_widen_the_band_more_than_sharp_ones():
    mask, affine = body((12, 12, 12), (1, 1, 1))
    away = 12 - np.linalg.norm(np.indices(mask.shape) + affine[:3, 3].reshape(3, 1, 1, 1), axis=0)
    maps = [mask, *(1 / (1 + np.exp(-away / flat)) for flat in (0.1, 2.0))]
    alone, sharp, flat = (cccd.reconstruct(one, affine).lofted.band.outer.mean() for one in maps)
    assert alone < sharp < 1
    # its slope at one half would take a logistic border down to nothing within twice its width
    assert flat == pytest.approx(FACTOR * 2 * 2 * 0.9, rel=0.2)


def test_samples_lie_within_the_band_as_often_as_it_says(ellipsoid):
    surface = ellipsoid[2].lofted
    band, normals = surface.band, surface.mesh.vertex_normals
    drawn = [list(draw_meshes(surface.mesh, band, 60, seed=1)) for _ in range(2)]
    off = [np.einsum("vc,vc->v", one.vertices - surface.vertices, normals) for one in drawn[0]]
    within = np.mean([(move <= band.outer) & (move >= -band.inner) for move in off])
    assert within == pytest.approx(0.9, abs=0.02)
    assert np.array_equal(drawn[0][7].vertices, drawn[1][7].vertices)
    volumes = np.quantile([one.volume for one in drawn[0]], [0.05, 0.95])
    assert np.diff(volumes) / np.diff(ellipsoid[2].volume_interval) == pytest.approx(1, abs=0.45)


def test_the_command_writes_samples_into_a_folder(tmp_path, capsys, refused):
    path = save(tmp_path / "ball.nii.gz", *body((12, 12, 12), (1, 1, 3)))
    given = ["surface", str(path), "-o", f"{tmp_path}/out/", "--json", "--samples"]
    assert main([*given, "3"]) == 0
    (made,) = json.loads(capsys.readouterr().out)["surfaces"]
    names = sorted(file.stem for file in (tmp_path / "out").iterdir())
    assert names == ["ball", "ball_1", "ball_2", "ball_3"]
    assert set(made["intervals"]) == {"volume_ml", "area_mm2", "diameter_mm"}
    assert "0 surfaces cannot be drawn" in refused(*given, "0")
