"""What is drawn over a slice lies where the organ lies."""

import base64
import io
import re
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image
from support.sample_results import BAND, BOUNDARIES, write_results
from support.shapes import structure_of

from cccd.containers import Frame
from cccd.store import write_structure
from cccd_junctions.boundary import extract_boundaries
from cccd_workflow.report.results import StructureFiles
from cccd_workflow.report.slices import _display, _letters, draw_slices
from cccd_workflow.stage_files import write_boundaries


@pytest.fixture(scope="module")
def sheet(tmp_path_factory):
    folder = tmp_path_factory.mktemp("results") / "phantom" / "liver"
    write_results(folder, "phantom", "liver")
    return draw_slices(StructureFiles(folder))


def path_points(svg, name):
    """Points (P, 2) of a layer's lines."""
    texts = re.search(rf'<path class="{name}" d="M([^"]*)z"', svg)[1].split("zM")
    return [np.array(text.split(), float).reshape(-1, 2) for text in texts]


def test_every_slice_of_the_organ_is_there_with_its_curve(sheet):
    assert [number for number, _ in sheet.pictures] == list(
        range(sheet.pictures[0][0], sheet.pictures[-1][0] + 1)
    )
    assert len(sheet.pictures) == sheet.count
    assert list(sheet.layers) == ["curve", "band", "corners"]  # pixels are drawn where they are no mask's
    assert sheet.sides == {"left": "R", "right": "L", "top": "A", "bottom": "P"}


def test_the_picture_is_bright_within_the_curve_and_dark_without(sheet):
    _, svg = sheet.pictures[len(sheet.pictures) // 2]
    width, height = map(int, re.search(r'viewBox="0 0 (\d+) (\d+)"', svg).groups())
    grey = Image.open(io.BytesIO(base64.b64decode(re.search(r"base64,([^\"]*)", svg)[1]))).convert("L")
    grey = np.asarray(grey.resize((width, height)), float)
    (curve,) = path_points(svg, "curve")
    x, y = curve.min(axis=0).astype(int), curve.max(axis=0).astype(int)
    inside = grey[x[1] + 9 : y[1] - 9, x[0] + 9 : y[0] - 9]
    outside = np.concatenate([grey[: x[1] - 2].ravel(), grey[y[1] + 3 :].ravel()])
    assert inside.mean() - outside.mean() > 80


def test_the_bands_lines_lie_on_both_sides_of_the_curve(sheet):
    _, svg = sheet.pictures[len(sheet.pictures) // 2]
    (curve,), band = path_points(svg, "curve"), path_points(svg, "band")
    inner, outer = sorted((np.ptp(line, axis=0) for line in band), key=np.sum)
    size = np.ptp(curve, axis=0)  # pixels of 1 mm; the curve goes through pixel centres
    np.testing.assert_allclose((outer - inner) / 2, sum(BAND.values()), atol=0.4)
    assert (inner < size).all()
    assert (outer > size).all()


def test_boundary_maps_show_their_pixels_and_need_no_mask(tmp_path):
    mask = np.zeros((30, 30, 4), bool)
    mask[5:22, 8:25, 1:3] = True
    whole = structure_of(mask, (1, 1, 3))
    boundaries = extract_boundaries(whole, BOUNDARIES)
    rings = np.zeros_like(mask)
    for k, part in zip(boundaries.slice, boundaries, strict=True):
        rings[part[:, 0], part[:, 1], k] = True
    write_structure(tmp_path / "structure.h5", replace(whole, mask=None, boundary=rings))
    write_boundaries(tmp_path / "boundaries.h5", boundaries)
    found = draw_slices(StructureFiles(tmp_path))
    assert list(found.layers) == ["boundary"]
    for number, svg in found.pictures:
        drawn = np.array(re.findall(r"M(\d+) (\d+)h1v1h-1z", svg), int)
        assert len(drawn) == rings[:, :, number].sum()
    assert draw_slices(StructureFiles(tmp_path / "nothing")) is None


AXES = {
    "LPS axial": (np.diag([-1.0, -1, 1, 1]), 2, "RLAP"),
    "RAS axial": (np.diag([1.0, 1, 1, 1]), 2, "RLAP"),
    "RAS coronal": (np.diag([1.0, 1, 1, 1]), 1, "RLSI"),
    "RAS sagittal": (np.diag([1.0, 1, 1, 1]), 0, "APSI"),
}


@pytest.mark.parametrize("name", AXES)
def test_slices_lie_as_a_radiologist_reads_them(name):
    affine, axis, letters = AXES[name]
    low, high = np.array([3, 5]), np.array([20, 30])
    matrix, right, down = _display(Frame(affine, axis, (40, 50, 60)), low, high)
    sides = _letters(right, down)
    assert "".join(sides[side] for side in ("left", "right", "top", "bottom")) == letters
    # every corner of the window falls on a corner of the picture
    corners = np.array([[3, 5, 1], [20, 5, 1], [3, 30, 1], [20, 30, 1.0]])
    size = np.abs(matrix[:, :2]) @ (high - low)
    for places, last in zip(matrix @ corners.T, size, strict=True):
        assert set(places) == {0, last}
