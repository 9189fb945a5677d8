"""What surfaces are lofted from: splines nearer to the shape than pixels are, corners, polygons."""

import numpy as np
import pytest
import trimesh
from shapes import curves_of, drawn, grid, structure_of

from cccd.containers import Sections
from cccd.curves import describe_curves, fit_splines
from cccd.reconstruction import reconstruct_mask
from cccd.settings.curves import CurveSettings
from cccd.settings.surface import LoftSettings
from cccd.surface import loft_surface
from cccd.surface.fields import distance_fields
from cccd.surface.outlines import lofted_outlines


def disc(radius, centre=(40.3, 39.8), shape=(80, 80, 5)):
    x, y, _ = grid(*shape)
    return np.hypot(x - centre[0], y - centre[1]) <= radius


def lofted_from(source):
    return LoftSettings(source=source)


@pytest.mark.parametrize("radius", [3.3, 8.1, 20.4, 33.7])
def test_outlines_enclose_the_area_of_their_pixels(radius):
    mask = disc(radius)
    outlines = lofted_outlines(Sections(curves_of(mask)), LoftSettings())
    assert outlines.of_pixels
    assert outlines.outwards == pytest.approx(0.5, abs=0.03)
    _, distance, _ = distance_fields(outlines)
    # the area of the zero contour, by each pixel's share
    share = np.clip(0.5 - distance[2], 0, 1).sum()
    assert share == pytest.approx(mask[:, :, 2].sum(), abs=1)
    assert outlines.areas == pytest.approx(mask.sum(axis=(0, 1)), rel=1e-9)


def test_outlines_with_holes_stand_for_their_pixels_whatever_they_are_drawn_by():
    mask = disc(30) & ~disc(12.2)
    for source in ("splines", "polygons"):
        outlines = lofted_outlines(Sections(curves_of(mask)), lofted_from(source))
        assert outlines.areas.reshape(5, 2).sum(axis=1) == pytest.approx(mask.sum(axis=(0, 1)), rel=1e-9)


def test_a_hole_closes_as_much_as_its_outline_opens():
    mask = disc(30) & ~disc(12.2)
    curves = curves_of(mask)
    outlines = lofted_outlines(Sections(curves), LoftSettings())
    assert outlines.outwards == pytest.approx(0.5, abs=0.03)
    _, distance, _ = distance_fields(outlines)
    assert np.clip(0.5 - distance[2], 0, 1).sum() == pytest.approx(mask[:, :, 2].sum(), abs=1)


def test_distances_of_a_disc_are_those_to_its_circle():
    radius, centre = 25.37, (40.3, 39.8)
    _, distance, origin = distance_fields(
        lofted_outlines(Sections(curves_of(disc(radius, centre))), LoftSettings())
    )
    i, j = np.indices(distance[0].shape)
    true = np.hypot(i + origin[0] - centre[0], j + origin[1] - centre[1]) - radius
    # a third of what rounding to pixels costs, 1 / sqrt(12)
    assert np.abs(distance[2] - true)[np.abs(true) < 15].mean() < 0.09


def test_drawn_contours_are_not_moved():
    angle = np.linspace(0, 2 * np.pi, 200, endpoint=False)
    circle = np.column_stack([40.1 + 20 * np.cos(angle), 39.7 + 20 * np.sin(angle)])
    outlines = lofted_outlines(Sections(drawn({k: [circle] for k in range(5)}, 9, size=80)), LoftSettings())
    assert not outlines.of_pixels
    assert np.all(outlines.outwards == 0)
    radii = np.hypot(*(outlines.curves.points - (40.1, 39.7)).T)
    assert radii == pytest.approx(20, abs=CurveSettings().tolerance_px + 0.01)


def test_normals_of_a_stack_of_ellipses_are_the_true_ones_to_two_degrees():
    x, y, z = grid(70, 60, 41)
    mask = ((x - 34.6) / 27) ** 2 + ((y - 29.7) / 21) ** 2 + ((z - 20) / 18.4) ** 2 <= 1
    structure = structure_of(mask[:, :, ::4], (1.0, 1.0, 4.0))
    surface = reconstruct_mask(structure, CurveSettings(), LoftSettings())
    mesh = trimesh.Trimesh(surface.vertices, surface.faces)
    away = mesh.triangles_center - (34.6, 29.7, 20.0)
    true = away / np.array([27, 21, 18.4]) ** 2
    true /= np.linalg.norm(true, axis=1, keepdims=True)
    angle = np.degrees(np.arccos(np.clip((mesh.face_normals * true).sum(axis=1), -1, 1)))
    assert mesh.is_watertight
    assert np.median(angle) < 2


def test_a_cylinder_keeps_its_cross_section():
    mask = disc(14.4, (20.2, 19.9), (41, 41, 30))
    surface = reconstruct_mask(structure_of(mask), CurveSettings(), LoftSettings())
    section = trimesh.Trimesh(surface.vertices, surface.faces).section((0, 0, 1), (0, 0, 14.3))
    area = section.to_2D()[0].area
    assert area == pytest.approx(mask[:, :, 14].sum(), rel=0.005)


def test_corner_splines_of_a_large_k_give_another_surface():
    x, y, z = grid(70, 60, 30)
    mask = (((x - 35) / 28) ** 4 + ((y - 30) / 22) ** 2 <= 1) & (z >= 3) & (z < 27)
    curves = curves_of(mask)
    volumes = {}
    for k in (7, 20):
        splines = describe_curves(curves, CurveSettings(method="corners", k=k)).splines
        volumes[k] = loft_surface(Sections(curves, splines), LoftSettings()).mesh.volume
    fitted = loft_surface(Sections(curves), LoftSettings()).mesh.volume
    assert fitted == pytest.approx(mask.sum(), rel=0.01)
    assert abs(volumes[20] - fitted) > 2 * abs(volumes[7] - fitted)


def test_polygons_are_the_pixels_themselves():
    curves = curves_of(disc(9.2) | disc(6.1, (52.0, 44.0)))
    outlines = lofted_outlines(Sections(curves), lofted_from("polygons"))
    assert outlines.curves is curves
    _, distance, _ = distance_fields(outlines)
    squares = (np.abs(distance) + 0.5) ** 2
    assert squares == pytest.approx(np.rint(squares), abs=1e-3)


def test_given_splines_are_the_ones_that_are_lofted():
    curves = curves_of(ellipse_mask())
    loose = fit_splines(curves, CurveSettings(tolerance_px=2.0))
    given = loft_surface(Sections(curves, loose), LoftSettings())
    assert not np.array_equal(given.vertices, loft_surface(Sections(curves), LoftSettings()).vertices)
    same = loft_surface(Sections(curves, fit_splines(curves)), LoftSettings())
    assert np.array_equal(same.vertices, loft_surface(Sections(curves), LoftSettings()).vertices)


def ellipse_mask():
    x, y, z = grid(50, 40, 20)
    return (((x - 25) / 18) ** 2 + ((y - 20) / 12) ** 2 <= 1) & (z >= 3) & (z < 16)


def test_touching_loops_grow_together():
    """Two lobes that touch in a pixel: moved outwards they overlap, and nothing is cut out there."""
    lobes = disc(8.3, (30, 40)) | disc(8.3, (46, 40))
    outlines = lofted_outlines(Sections(curves_of(lobes)), LoftSettings())
    _, distance, origin = distance_fields(outlines)
    assert distance[2][38 - origin[0], 40 - origin[1]] < 0
