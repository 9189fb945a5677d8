"""A picture comes out whether VTK lives or dies, and says which it was."""

import numpy as np
import pytest
import trimesh
from PIL import Image

from cccd.geometry.mesh import Mesh
from cccd.store import write_ply
from cccd_workflow.report import render


@pytest.fixture
def bottle(tmp_path):
    """A body that looks different from each side: long in z, wide in x, a knob in front (+y)."""
    body = trimesh.creation.icosphere(subdivisions=4)
    body.apply_scale([20, 8, 30])
    knob = trimesh.creation.icosphere(subdivisions=3, radius=5)
    knob.apply_translation([0, 12, 0])
    path = tmp_path / "a name with spaces é.ply"
    both = trimesh.util.concatenate([body, knob])
    write_ply(path, Mesh(np.array(both.vertices), np.array(both.faces)), "a test")
    return path


def silhouettes(path):
    """Widths and heights in pixels of the three views."""
    alpha = np.asarray(Image.open(path).convert("RGBA"))[..., 3] > 128
    sizes = []
    for view in np.split(alpha, 3, axis=1):
        rows, columns = np.flatnonzero(view.any(axis=1)), np.flatnonzero(view.any(axis=0))
        sizes.append((np.ptp(columns) + 1, np.ptp(rows) + 1))
    return np.array(sizes, float)


def expect_proportions(path):
    (front, left, top) = silhouettes(path)
    assert front[0] / front[1] == pytest.approx(40 / 60, rel=0.04)
    assert left[0] / left[1] == pytest.approx(25 / 60, rel=0.04)
    assert top[0] / top[1] == pytest.approx(40 / 25, rel=0.04)


def test_matplotlib_draws_when_vtk_dies(bottle, tmp_path, monkeypatch):
    crash = tmp_path / "crash.py"
    crash.write_text("import os, signal\nos.kill(os.getpid(), signal.SIGSEGV)\n")
    monkeypatch.setattr(render, "__file__", str(crash))
    picture = tmp_path / "picture.png"
    assert render.render_surface(bottle, picture, pixels=150) == "matplotlib"
    assert render.picture_renderer(picture) == "matplotlib"
    assert Image.open(picture).size == (450, 150)
    expect_proportions(picture)


def test_vtk_draws_the_same_sides(bottle, tmp_path):
    picture = tmp_path / "picture.png"
    if render.render_surface(bottle, picture, pixels=150) != "vtk":
        pytest.skip(f"VTK cannot draw off screen here; {render.VTK_PACKAGE} would let it")
    assert render.picture_renderer(picture) == "vtk"
    expect_proportions(picture)


def test_a_hanging_vtk_is_given_up(bottle, tmp_path, monkeypatch):
    sleeper = tmp_path / "sleep.py"
    sleeper.write_text("import time\ntime.sleep(60)\n")
    monkeypatch.setattr(render, "__file__", str(sleeper))
    monkeypatch.setattr(render, "TIME_LIMIT_S", 0.5)
    assert render.render_surface(bottle, tmp_path / "p.png", pixels=60) == "matplotlib"


def test_nothing_is_left_when_the_mesh_cannot_be_read(tmp_path):
    broken = tmp_path / "broken.ply"
    broken.write_bytes(b"ply\n")
    with pytest.raises(Exception, match=r"."):
        render.render_surface(broken, tmp_path / "p.png", pixels=60)
    assert [path.name for path in tmp_path.iterdir()] == ["broken.ply"]


def test_picture_of_unknown_origin(tmp_path):
    Image.new("RGB", (4, 4)).save(tmp_path / "p.png")
    assert render.picture_renderer(tmp_path / "p.png") is None
