import numpy as np
import pytest
from shapes import ball, curves_of

from cccd.containers import Curves, Frame, Sections
from cccd.settings.surface import LoftSettings
from cccd.surface.fields import distance_fields, interpolated_fields
from cccd.surface.outlines import Outlines, lofted_outlines, through_pixel_centres


def border(curves):
    """Outlines that are an organ's border themselves."""
    areas = curves.polygons.signed_areas  # of outer ones
    return Outlines(curves, np.zeros(len(curves)), areas, of_pixels=False)


def polygons(curves):
    return lofted_outlines(Sections(curves), LoftSettings(source="polygons"))


def circles(radii, spacing=(1.0, 1.0, 1.0)):
    angle = np.linspace(0, 2 * np.pi, 300, endpoint=False)
    points = [np.column_stack([30 + r * np.cos(angle), 30 + r * np.sin(angle)]) for r in radii]
    frame = Frame(np.diag([*spacing, 1.0]), 2, (60, 60, 99))
    offsets = np.arange(len(radii) + 1) * 300
    return Curves(
        np.vstack(points), offsets, np.arange(len(radii), dtype=np.int32), np.zeros(len(radii), bool), frame
    )


def test_distances_to_drawn_outlines_are_exact_near_them():
    curves = circles([12.37])
    _, distance, origin = distance_fields(border(curves))
    i, j = np.indices(distance[0].shape)
    true = np.hypot(i + origin[0] - 30, j + origin[1] - 30) - 12.37
    near = np.abs(true) < 2
    assert distance[0][near] == pytest.approx(true[near], abs=0.01)
    assert np.array_equal(distance[0] < 0, true < 0)


def test_distances_of_pixels_are_negative_at_the_centres_of_the_pixels():
    mask = ball(radius=20) & ~ball(radius=8)
    curves = curves_of(mask)
    assert through_pixel_centres(curves)
    slices, distance, origin = distance_fields(polygons(curves))
    i, j = np.nonzero(distance[30 - slices[0]] < 0)
    assert np.array_equal(np.column_stack([i, j]) + origin, np.argwhere(mask[:, :, 30]))


def test_levels_between_slices_stay_between_them():
    curves = circles([10.0, 14.0, 15.0, 9.0], (1.0, 1.0, 6.0))
    slices, distance, _ = distance_fields(border(curves))
    fields = list(interpolated_fields(slices, distance, 6.0, 1.5))
    assert np.diff([field.z for field in fields]) == pytest.approx(1.5)
    assert [field.source_slice for field in fields if field.source_slice is not None] == [0, 1, 2, 3]
    for low in range(3):
        pair = distance[low : low + 2]
        for field in fields[4 * low : 4 * low + 5]:
            assert np.all(field.distance >= pair.min(axis=0) - 1e-4)
            assert np.all(field.distance <= pair.max(axis=0) + 1e-4)
