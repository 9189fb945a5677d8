"""A VTK filter makes the surface that the library makes, in the image's place, wherever its extent begins."""

import logging

import numpy as np
import pytest

import cccd

pv = pytest.importorskip("pyvista")
from cccd.paraview_plugin import SmoothSurface  # noqa: E402

SPACING = (1.0, 0.9, 2.0)


def image():
    made = pv.ImageData(dimensions=(22, 24, 10), spacing=SPACING, origin=(5, -3, 7))
    away = np.linalg.norm(made.points - np.array([15, 8, 16]), axis=1)
    made["organ"] = np.where(away <= 8, 3, 0).astype(np.uint8)
    return made


def filtered(data, **settings):
    found = SmoothSurface()
    for name, value in settings.items():
        getattr(found, f"Set{name}")(value)
    found.SetInputDataObject(data)
    found.Update()
    return pv.wrap(found.GetOutputDataObject(0))


def test_it_is_the_library_s_surface_in_the_image_s_place():
    whole = image()
    voxels = (whole["organ"] > 0).reshape(whole.dimensions, order="F")
    expected = cccd.reconstruct(voxels, np.array(whole.index_to_physical_matrix))
    assert filtered(whole, Label=3).points == pytest.approx(expected.vertices, abs=1e-4)
    part = whole.extract_subset((1, 21, 2, 23, 0, 9))  # its extent does not begin at 0
    assert filtered(part, Annotated=2).points == pytest.approx(expected.vertices, abs=1e-4)


def test_bad_images_get_one_line(caplog):
    with caplog.at_level(logging.ERROR):
        assert filtered(image(), Label=9).n_points == 0
        assert filtered(pv.ImageData(dimensions=(4, 4, 4))).n_points == 0
    said = [record.getMessage() for record in caplog.records if record.name.startswith("cccd")]
    assert len(said) == 2
    assert "it has no active array of labels" in said[1]
