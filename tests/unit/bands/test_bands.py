"""Bands of surfaces whose true surface is known, and what is written of them."""

import json

import numpy as np
import pytest

import cccd
from cccd.bands import Band, Calibration, estimate_band
from cccd.bands.calibration import SHIPPED, SHIPPED_SHA256
from cccd.bands.scale import WEIGHTS, WEIGHTS_SHA256
from cccd.bands.signs import Slices
from cccd.cli import main
from cccd.errors import InputError
from cccd.files.write import write_surface
from cccd.geometry.distance import to_mask
from cccd.geometry.mesh import Mesh
from cccd.inputs.load import structure_of_array
from cccd.settings.root import Settings
from cccd.store import write_control_meshes
from cccd.surface.between import DISTANCES, Between, distance_table, least_distance
from cccd.surface.measure import measure_surface
from cccd.surface.surface import read_surface


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
    assert low < surface.volume < high


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
    bands = []
    for times in (1.0, 3.0):
        spacing = np.full(2, times)
        distance = np.stack([to_mask(mask[:, :, one], spacing) for one in k])
        moved = Mesh(times * (mesh.vertices - affine[:3, 3]), mesh.faces)
        bands.append(estimate_band(moved, Slices(4 * times * k, distance, spacing), 0.9, Calibration.read()))
    assert np.allclose(bands[1].outer, 3 * bands[0].outer, rtol=1e-3)
    assert np.allclose(bands[1].inner, 3 * bands[0].inner, rtol=1e-3)


def test_a_larger_share_is_a_wider_band():
    mask, affine = body((14, 12, 14), (1, 1, 4))
    widths = [
        cccd.reconstruct(mask, affine, settings=settings(band=share)).lofted.band.outer.mean()
        for share in (0.5, 0.8, 0.9, 0.95)
    ]
    assert np.all(np.diff(widths) > 0)


def test_slices_unlike_those_of_the_calibration_are_marked():
    mask, affine = body((70, 70, 140), (1, 1, 40))
    surface = cccd.reconstruct(mask, affine)
    assert surface.lofted.band.extrapolated
    assert any("extrapolated" in warning for warning in surface.warnings)


def test_files_carry_the_band(ellipsoid, tmp_path):
    pyvista = pytest.importorskip("pyvista")
    surface = ellipsoid[2].lofted
    write_surface(tmp_path / "surface.ply", surface)
    write_control_meshes(
        tmp_path / "surface.h5",
        surface.bodies,
        surface.frame,
        surface.report,
        (surface.band, surface.vertices),
    )
    back = read_surface(tmp_path / "surface.h5", tmp_path / "surface.ply")
    for side in ("inner", "outer"):
        assert np.allclose(getattr(back.band, side), getattr(surface.band, side), rtol=1e-6)
    write_surface(tmp_path / "surface.vtp", back)
    arrays = pyvista.read(tmp_path / "surface.vtp").point_data
    for name in ("inner_mm", "outer_mm"):
        assert arrays[name].shape == (len(surface.vertices),)
        assert np.all(arrays[name] > 0)


def test_sides_enclose_each_other(ellipsoid):
    surface = ellipsoid[2]
    sides = surface.sides
    assert sides["inner"].volume < surface.volume < sides["outer"].volume
    assert sides["outer"].faces is surface.faces


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


def test_metrics_hold_the_interval():
    mask, affine = body((12, 12, 12), (1, 1, 3))
    surface = cccd.reconstruct(mask, affine).lofted
    figures = measure_surface(surface, structure_of_array(mask, affine, Settings().import_))
    assert figures["volume_low_ml"] < figures["volume_ml"] < figures["volume_high_ml"]
    assert figures["band"] == 0.9
    assert figures["band_extrapolated"] is False


def save(path, mask, affine):
    import nibabel

    nibabel.Nifti1Image(mask.astype(np.uint8), affine).to_filename(path)
    return path


def test_the_command_prints_the_interval_and_writes_both_sides(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = save(tmp_path / "ball.nii.gz", *body((12, 12, 12), (1, 1, 3)))
    assert main(["surface", str(path), "-o", "ball.stl", "--band", "--json"]) == 0
    (made,) = json.loads(capsys.readouterr().out)["surfaces"]
    assert made["volume_low_ml"] < made["volume_ml"] < made["volume_high_ml"]
    assert made["band"] == 0.9
    assert not made["band_extrapolated"]
    assert made["files"] == ["ball.stl", "ball_inner.stl", "ball_outer.stl"]
    assert all((tmp_path / name).is_file() for name in made["files"])


def drawn(tmp_path, keep):
    mask, affine = body((15, 15, 15), (1, 1, 1))
    kept = np.zeros_like(mask)
    kept[:, :, keep] = mask[:, :, keep]
    return save(tmp_path / "drawn.nii.gz", kept, affine)


def test_the_next_slice_is_one_that_nobody_drew(tmp_path, capsys):
    keep = [4, 7, 10, 22, 25, 28]
    path = drawn(tmp_path, keep)
    assert main(["next", str(path), "--annotated", "nonempty", "--json"]) == 0
    slices = json.loads(capsys.readouterr().out)["slices"]
    named = [one["slice"] for one in slices]
    assert set(named) == {2, 5, 8, 16, 23, 26, 29}  # the middle of each gap
    assert named[0] == 16  # of the widest, where the band is widest too
    shrinks = [one["lowers_error"] for one in slices]
    assert shrinks == sorted(shrinks, reverse=True)
    assert shrinks[0] > 0
    assert main(["next", str(path), "--annotated", "nonempty"]) == 0
    assert f"annotate slice {named[0]} next" in capsys.readouterr().out


def test_of_equal_gaps_those_where_the_surface_bends_come_before_straight_ones(tmp_path, capsys):
    x, y, z = np.indices((34, 34, 52)) - np.array([16.5, 16.5, 0]).reshape(3, 1, 1, 1)
    radius = np.sqrt(np.maximum(14.0**2 - np.maximum(z - 32, 0) ** 2, 0))  # a cylinder that ends in a dome
    mask = (np.hypot(x, y) <= radius) & (z >= 5)
    kept = np.zeros_like(mask)
    kept[:, :, 6:45:6] = mask[:, :, 6:45:6]
    path = save(tmp_path / "dome.nii.gz", kept, np.eye(4))
    assert main(["next", str(path), "--annotated", "nonempty", "--json"]) == 0
    shrinks = {one["slice"]: one["lowers_error"] for one in json.loads(capsys.readouterr().out)["slices"]}
    assert min(shrinks[39], shrinks[33]) > max(shrinks[k] for k in (9, 15, 21, 27))


def test_of_evenly_spaced_slices_one_beyond_the_end_counts_half(tmp_path, capsys):
    x, y, z = np.indices((34, 34, 52)) - np.array([16.5, 16.5, 25]).reshape(3, 1, 1, 1)
    mask = np.sqrt(x**2 + y**2 + z**2) < 15  # slices 11 to 39

    def ranked(keep):
        kept = np.zeros_like(mask)
        kept[:, :, keep] = mask[:, :, keep]
        path = save(tmp_path / "ball.nii.gz", kept, np.eye(4))
        assert main(["next", str(path), "--annotated", "nonempty", "--json"]) == 0
        slices = json.loads(capsys.readouterr().out)["slices"]
        return {one["slice"]: one["lowers_error"] for one in slices}

    even, uneven = (ranked(sorted({*range(12, 37, 3)} - missing)) for missing in (set(), {24}))
    assert next(iter(even)) in (13, 34)  # between the slices nearest to the poles
    # a wider gap far away changes little at the poles, but nobody drew every n-th slice: more may follow
    assert uneven[37] / uneven[34] == pytest.approx(2 * even[37] / even[34], rel=0.15)


def test_the_next_slice_lies_where_neighbours_do_not_foretell_a_slice(tmp_path, capsys):
    x, y, z = np.indices((44, 34, 60)) - np.array([16.5, 16.5, 0]).reshape(3, 1, 1, 1)
    aside = 9 * np.clip((z - 26) / 3, 0, 1)  # a cylinder that steps aside between slices 26 and 29
    mask = (np.hypot(x - aside, y) <= 10) & (z >= 5) & (z < 55)
    kept = np.zeros_like(mask)
    kept[:, :, 6:55:6] = mask[:, :, 6:55:6]
    path = save(tmp_path / "step.nii.gz", kept, np.eye(4))
    assert main(["next", str(path), "--annotated", "nonempty", "--json"]) == 0
    lowers = {one["slice"]: one["lowers_error"] for one in json.loads(capsys.readouterr().out)["slices"]}
    assert next(iter(lowers)) == 27
    assert lowers[27] > 3 * max(lowers[k] for k in lowers if k not in (21, 27, 33))


def test_nothing_is_left_to_draw(tmp_path, capsys):
    path = save(tmp_path / "ball.nii.gz", *body((9, 9, 9), (1, 1, 2)))
    assert main(["next", str(path)]) == 1
    assert "no slice is left to draw" in capsys.readouterr().err


def test_a_mask_of_one_slice_has_no_next_slice(tmp_path, capsys):
    mask = np.zeros((20, 20, 9), bool)
    mask[5:12, 5:12, 4] = True
    path = save(tmp_path / "flat.nii.gz", mask, np.diag([1, 1, 3, 1.0]))
    assert main(["next", str(path)]) == 1
    assert len(capsys.readouterr().err.strip().splitlines()) == 1


# calibration ------------------------------------------------------------------------------------------


def sheet(folder, count, size=9):
    rows = []
    for number in range(count):
        name = f"ball{number}.nii.gz"
        save(folder / name, *body((size + number % 4, size, size + number % 3), (1, 1, 1)))
        rows.append(f"case{number}\tball\t{name}\n")
    path = folder / "sheet.tsv"
    path.write_text("case\torgan\tmask\n" + "".join(rows))
    return path


def test_too_few_organs_are_refused_before_any_work(tmp_path, capsys):
    assert main(["calibrate", str(sheet(tmp_path, 3)), "-o", str(tmp_path / "own.json")]) == 1
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert "3 organs are too few to guarantee 90%" in line
    assert not (tmp_path / "own.json").exists()


def test_own_masks_make_a_calibration_that_is_used(tmp_path, capsys):
    path = tmp_path / "own.json"
    assert main(["calibrate", str(sheet(tmp_path, 12)), "-o", str(path)]) == 0
    assert "12 organs" in capsys.readouterr().out
    own = Calibration.read(path)
    assert own.regimes
    mask, affine = body((10, 9, 10), (1, 1, 3))
    surfaces = [
        cccd.reconstruct(mask, affine, settings=settings(calibration=name)) for name in (None, str(path))
    ]
    shipped, mine = (surface.lofted.band.outer for surface in surfaces)
    assert np.allclose(mine / shipped, (mine / shipped)[0])
    assert (mine / shipped)[0] != 1


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        ("{", "that is no calibration"),
        ('{"scale": "x"}', "that is no calibration"),
        ('{"scale": "x", "made_of": "", "regimes": []}', "another version"),
        (None, "cannot be read"),
    ],
)
def test_what_is_no_calibration_is_refused(tmp_path, content, problem):
    path = tmp_path / "own.json"
    if content is not None:
        path.write_text(content)
    with pytest.raises(InputError, match=problem):
        Calibration.read(path)


def test_shares_that_no_factor_is_kept_for_are_refused():
    none = Calibration((), "nothing", "")
    with pytest.raises(InputError, match="no factors for a share"):
        none.factors(3.0, 0.9)


def test_shipped_files_are_those_that_their_hashes_name():
    import hashlib

    for path, name in ((WEIGHTS, WEIGHTS_SHA256), (SHIPPED, SHIPPED_SHA256)):
        assert hashlib.sha256(path.read_bytes()).hexdigest() == name


def test_a_band_moves_to_another_mesh():
    band = Band(np.array([1.0, 2.0]), np.array([3.0, 4.0]), 0.9, 1.0, False)
    moved = band.moved_to(np.array([[0.0, 0, 0], [9, 0, 0]]), np.array([[8.0, 0, 0], [1, 0, 0], [9, 1, 0]]))
    assert moved.inner.tolist() == [2, 1, 2]
    assert moved.outer.tolist() == [4, 3, 4]
