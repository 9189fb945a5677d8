"""One template lies on every subject, at the same places, in any order; what is no such organ is listed."""

import functools
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import pyvista
from scipy.spatial.transform import Rotation
from support.closed_shapes import sphere

from cccd.cli import main
from cccd.errors import InputError
from cccd.geometry.distance import nearest_faces
from cccd.geometry.mesh import Mesh
from cccd.store import read_bodies, read_ply, write_ply
from cccd_shapes import FROM_MEAN
from cccd_shapes.cohort import Cohort, aligned, first_template, fit_cohort, fit_subject, read_fit
from cccd_shapes.fit import Fit, fit_template, similarity
from cccd_shapes.model import _doubts, describe
from cccd_shapes.series import fit_series
from cccd_shapes.subjects import MIRROR, Row, Subject, read_sheet
from cccd_shapes.template import Template, control_mesh_of

#: Control points: enough for smooth bodies.
POINTS = 110
#: Directions of two bumps and a hollow, and how high they are.
FEATURES = (((1, 0.2, 0.3), 0.5), ((-0.3, 1, -0.5), 0.4), ((0, -0.7, 0.8), -0.35))


def nearness(unit, way):
    return np.exp(-8 * (1 - unit @ np.array(way) / np.linalg.norm(way)))


@functools.cache
def body() -> Mesh:
    """A body with two bumps and a hollow: places that a correspondence has to find."""
    ball = sphere(10.0, subdivisions=4)
    unit = ball.vertices / 10
    height = np.ones(len(unit))
    for way, rise in FEATURES:
        height += rise * nearness(unit, way)
    return Mesh(10 * unit * height[:, None] * (1, 1.2, 1.5), ball.faces)


def deformed(seed: int, size: float = 1.0) -> Mesh:
    """The body, moved by a random smooth field of some waves, with the same vertices."""
    draw = np.random.default_rng(seed)
    vertices = body().vertices
    move = np.zeros_like(vertices)
    for _ in range(4):
        wave, phase = draw.normal(size=(3, 3)) / 18, draw.uniform(0, 6.3, 3)
        move += np.sin(vertices @ wave.T + phase) @ draw.normal(size=(3, 3)).T
    return Mesh(vertices + size * move / 2, body().faces)


def subject(name: str, mesh: Mesh, time: float | None = None) -> Subject:
    return Subject(Row("sheet.tsv", name, None, None, False, "", time), mesh, 1.0, 0.5)


def on_body(points, mesh: Mesh):
    """Where on the body the points of a deformed one are."""
    face = mesh.faces[nearest_faces(points, mesh)]
    a, b, c = (mesh.vertices[face[:, k]] for k in range(3))
    edges = np.stack([b - a, c - a], axis=2)
    weights = np.einsum("nij,nj->ni", np.linalg.pinv(edges), points - a).clip(0, 1)
    corners = [body().vertices[face[:, k]] for k in range(3)]
    return (
        corners[0] + weights[:, :1] * (corners[1] - corners[0]) + weights[:, 1:] * (corners[2] - corners[0])
    )


def subjects():
    """Five of one organ, and a ball with a wrong label."""
    return [subject(f"s{n}", deformed(n, 0.25)) for n in range(5)] + [
        subject("wrong", sphere(12.0, subdivisions=4))
    ]


@pytest.fixture(scope="module")
def cohort(tmp_path_factory):
    folder = tmp_path_factory.mktemp("cohort")
    return fit_cohort(subjects(), folder, POINTS), folder


def test_a_template_lies_at_the_same_places_of_every_subject():
    template = Template(control_mesh_of(body(), POINTS))
    before = template.spline.tessellate(0).vertices
    unit = before / (1, 1.2, 1.5)
    unit /= np.linalg.norm(unit, axis=1, keepdims=True)
    on_feature = np.max([nearness(unit, way) for way, _ in FEATURES], axis=0) > 0.25
    for seed in range(3):
        after = fit_template(template, deformed(seed)).spline.tessellate(0).vertices
        off = np.linalg.norm(on_body(after, deformed(seed)) - before, axis=1)
        assert np.median(off[on_feature]) < 0.5  # mm: half a pixel
        assert np.median(np.linalg.norm(after - before, axis=1)) > 1


def test_fits_are_closed_near_and_simple_and_what_is_no_such_organ_is_listed(cohort):
    found, _ = cohort
    assert [bool(problem) for problem in found.problems] == [False] * 5 + [True]
    assert "mixtures of the others" in found.problems[-1]
    for fit in found.fits[:5]:
        mesh = fit.spline.tessellate(2)
        assert fit.rms < 0.1
        assert mesh.is_closed_manifold
        assert len(mesh.self_intersections()) == 0


def test_what_masks_of_many_subjects_warn_of_is_one_line(cohort):
    noted = [replace(one, notes=(f"filled {n} cavities",)) for n, one in enumerate(cohort[0].subjects)]
    assert _doubts(replace(cohort[0], subjects=noted))[0].startswith("filled 0 cavities: 6 subjects (")


def test_the_order_of_rows_changes_no_bit_and_fits_are_kept(cohort):
    found, folder = cohort
    before = {path: path.stat().st_mtime_ns for path in folder.rglob("*.h5")}
    again = fit_cohort([subjects()[n] for n in (3, 0, 5, 4, 2, 1)], folder, POINTS)
    assert [one.name for one in again.subjects] == [one.name for one in subjects()]
    for one, other in zip(found.fits, again.fits, strict=True):
        assert np.array_equal(one.spline.vertices, other.spline.vertices)
    assert before == {path: path.stat().st_mtime_ns for path in folder.rglob("*.h5")}


def test_the_job_of_a_round_and_a_subject_makes_the_same(cohort):
    (found, folder), fits = cohort, []
    template = first_template(found.subjects, POINTS)
    for number in range(1, FROM_MEAN):
        fits = [read_fit(folder / f"round_{number}" / f"{one.name}.h5") for one in found.subjects]
        template = Cohort.judged(found.subjects, fits, template).mean()
    kept = read_fit(folder / f"round_{FROM_MEAN}" / "s0.h5")
    assert fit_subject(template, found.subjects[0], fits[0]).rms == kept.rms
    strict = [replace(one, tolerance=0.001) for one in found.subjects]
    with pytest.raises(InputError, match=r"s0: .* mm \(rms\) from its own surface, more than 0.001"):
        Cohort.judged(strict, fits, template)


def test_a_similarity_is_found_exactly():
    template = Template(control_mesh_of(body(), 2 * POINTS))
    affine = np.eye(4)
    affine[:3, :3] = 1.4 * Rotation.from_euler("z", 25, degrees=True).as_matrix()
    affine[:3, 3] = 30, -20, 7
    moved = template.spline.tessellate(2).transformed(affine)
    assert similarity(template, moved) == pytest.approx(affine, abs=0.02)


def test_alignment_undoes_rotations_and_sizes_only_where_asked_and_modes_are_smooth():
    template = Template(control_mesh_of(body(), POINTS))
    shape, turn = template.spline.vertices, np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    shapes = np.array([shape, 1.5 * shape @ turn.T + 9])
    same = aligned(shapes, template, scaled=True)
    assert same[0] == pytest.approx(same[1], abs=1e-6)
    kept = aligned(shapes, template, scaled=False)
    assert 1.5 * kept[0] == pytest.approx(kept[1], abs=1e-6)
    modes = template.modes  # smooth ones, of unit size
    assert modes.T @ (template.metric @ modes) == pytest.approx(np.eye(modes.shape[1]), abs=1e-6)
    bent = np.einsum("vk,vk->k", modes, template.bending @ modes)
    assert bent[0] == pytest.approx(0, abs=1e-9)
    assert bent[1] < bent[10] < bent[-1]


PERIOD = 0.8


def beating(time):
    """Half axes in mm of an ellipsoid that beats."""
    return np.array([10, 11, 14]) * (1 + np.array([0.12, 0.12, 0.06]) * np.cos(2 * np.pi * time / PERIOD))


def test_a_series_has_the_period_and_the_volumes_of_a_beating_ellipsoid():
    """Frames of two beats, each off by .2 mm (rms) all around."""
    draw, ball = np.random.default_rng(0), sphere(1.0, subdivisions=3)
    times = draw.uniform(0, 2 * PERIOD, 14)
    unit = control_mesh_of(ball, 60)
    axes = [beating(time) + draw.normal(0, 0.2) for time in times]
    frames = [
        subject(f"f{n}", Mesh(ball.vertices * by, ball.faces), time)
        for n, (time, by) in enumerate(zip(times, axes, strict=True))
    ]
    fits = [Fit(unit.moved(unit.vertices * by), 0.0, 0) for by in axes]
    template = Template(unit.moved(unit.vertices * 11))
    cohort = Cohort(frames, fits, template, [""] * 14)
    with pytest.raises(InputError, match="only 0 of 14 subjects fit"):
        fit_series(replace(cohort, subjects=[replace(one, tolerance=0.01) for one in frames]), PERIOD)
    _, series = fit_series(cohort, PERIOD)
    assert series.at(0.3).vertices == pytest.approx(series.at(0.3 + PERIOD).vertices, abs=1e-9)
    size = ball.volume / 1000
    time, found, low, high = series.volumes.T
    true, at_frames = ([size * np.prod(beating(one)) for one in every] for every in (time, times))
    off = size * np.prod(axes, axis=1) - at_frames
    assert np.sqrt(np.mean((found - true) ** 2)) < 0.75 * np.sqrt(np.mean(np.square(off)))
    assert np.mean((low <= true) & (true <= high)) > 0.8
    assert series.ejection[1] < 1 - min(true) / max(true) < series.ejection[2]


def test_the_command_takes_mirrored_subjects_and_writes_the_same_faces(tmp_path):
    lines = ["name\tsurface\tmirrored\tgroup"]
    for n in range(6):
        mesh, mirrored = deformed(n, 0.5), n % 2
        write_ply(tmp_path / f"{n}.ply", mesh.transformed(MIRROR) if mirrored else mesh, "")
        lines.append(f"s{n}\t{n}.ply\t{'yes' if mirrored else 'no'}\t{'left' if mirrored else 'right'}")
    (tmp_path / "sheet.tsv").write_text("\n".join(lines))
    out = tmp_path / "model"
    words = ["shapes", tmp_path / "sheet.tsv", "-o", out, "--points", POINTS, "--permutations", 99]
    assert main([str(word) for word in words]) == 0
    table = pd.read_csv(out / "subjects.csv")
    assert table.fits.tolist() == ["yes"] * 6
    assert table.volume_ml.to_numpy() == pytest.approx(table.own_volume_ml.to_numpy(), rel=0.01)
    meshes = [read_ply(out / "fitted" / f"s{n}" / "surface.ply") for n in range(6)]
    for n, mesh in enumerate(meshes):
        assert np.array_equal(mesh.faces[:, :: -1 if n % 2 else 1], meshes[0].faces)
        assert mesh.volume > 0
        own = deformed(n, 0.5).transformed(MIRROR) if n % 2 else deformed(n, 0.5)
        assert mesh.vertices.mean(axis=0) == pytest.approx(own.vertices.mean(axis=0), abs=2)
    read = pyvista.read(out / "fitted" / "s0" / "surface.ply")  # as scikit-shapes does
    assert read.is_all_triangles
    assert read.clean().n_points == len(meshes[0].vertices)
    (spline,) = read_bodies(out / "modes" / "mode_1_plus_2" / "surface.h5")
    assert spline.tessellate(1).is_closed_manifold
    points = np.loadtxt(out / "particles" / "s0_local.particles")
    assert points == pytest.approx(meshes[0].vertices[: len(points)], abs=1e-5)
    assert len(pd.read_csv(out / "scores.csv")) == 6
    assert (out / "groups.vtp").is_file()
    page = (out / "modes.html").read_text()
    assert "6 of 6 subjects" in page
    assert "Mode 1 (" in page
    assert "p = " in page


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("name\tsurfaces\na\tb.ply", "unknown column 'surfaces'"),
        ("name\nb", "columns are missing"),
        ("name\tmask\na\tb.nii.gz\tx\ty", "row 2: 4 fields under 2 columns"),
        ("name\tsurface\na\tb.ply", "sheet.tsv row 2: .*there is no such file"),
        ("name\tsurface\na b\tsheet.tsv", "row 2: name 'a b'"),
        ("name\tsurface\na\tsheet.tsv", "sheet.tsv is not a surface"),
        ("name\tmask\tmirrored\na\tsheet.tsv\tperhaps", "mirrored is 'perhaps'"),
        ("name\tmask\na\tsheet.tsv\na\tsheet.tsv", "the name 'a' is there twice"),
        ("name\tmask\na\tsheet.tsv", "it has fewer than 3 subjects; add rows"),
        ("name\tmask\ttime\na\tsheet.tsv\tnow", "time is 'now'"),
        ("name\tmask\ttime\na\tsheet.tsv\tnan", "row 2: time is 'nan'; write a number"),
        ("name\tmask\ttime\na\tsheet.tsv\t1\nb\tsheet.tsv\t", "row 3: it has no time"),
    ],
)
def test_a_wrong_sheet_is_one_line(tmp_path, text, said):
    (tmp_path / "sheet.tsv").write_text(text)
    with pytest.raises(InputError, match=said):
        read_sheet(tmp_path / "sheet.tsv")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("--tolerance=0", "--tolerance: it is 0; give a number of at least 0.001"),
        ("--tolerance=nan", "--tolerance: it is nan"),
        ("--period=inf", "--period: it is inf"),
        ("--period=0.8", "--period: it is of a series; give the sheet a column time"),
        ("4 times", "sheet.tsv: 4 frames are too few; give 6 that fit"),
        ("6 times", "sheet.tsv: the frames leave parts of the time open"),
    ],
)
def test_what_a_call_lacks_is_said_before_any_surface_is_made(tmp_path, refused, words, said):
    option, times = ([words], ["", "", ""]) if words.startswith("-") else ([], int(words[0]) * ["1"])
    rows = [f"s{n}\tsheet.tsv\t{time}" for n, time in enumerate(times)]
    (tmp_path / "sheet.tsv").write_text("\n".join(["name\tmask\ttime", *rows]))
    assert said in refused("shapes", tmp_path / "sheet.tsv", "-o", tmp_path / "model", *option)
    assert not (tmp_path / "model").exists()


def test_groups_that_cannot_be_compared_are_said_and_nothing_of_another_sheet_stays(cohort, tmp_path):
    (old := tmp_path / "fitted" / "gone" / "surface.ply").parent.mkdir(parents=True)
    old.write_text("")
    for groups, told in (("aaaaaa", "(a: 5)"), ("aaabb ", "(a: 3, b: 2)"), ("aaa   ", "(a: 3, no group: 2)")):
        named = zip(cohort[0].subjects, groups, strict=True)
        grouped = [replace(one, row=replace(one.row, group=name.strip())) for one, name in named]
        made = describe(replace(cohort[0], subjects=grouped), tmp_path, permutations=19)
        assert f"groups are not compared {told}" in made["warnings"][-1]
        assert "p" not in made
    assert "wrong does not fit: " in (tmp_path / "modes.html").read_text()
    assert not old.exists()
