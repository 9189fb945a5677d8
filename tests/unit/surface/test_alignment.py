"""Matched points run straight along a tube: no twist, no shear, no change of order."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from shapes import ellipse

from cccd.settings.surface import FittingSettings
from cccd.surface.alignment import align, at_fractions, outward_normals
from cccd.surface.tubes import Section, Tube

AROUND = 96


def tube_of(outlines):
    sections = [Section.of_outline(float(z), points) for z, points in enumerate(outlines)]
    return Tube(sections, (None, None), False, 0, ("cap", "cap"))


def lines_of(outlines, count=AROUND):
    """Matched points (A, count, 2): every column is one line along the tube."""
    return at_fractions(*align(tube_of(outlines), count, FittingSettings()))


def turned(points, centre=30.0):
    """Angles (A, M) around the axis, without jumps along the tube."""
    return np.unwrap(np.arctan2(points[..., 1] - centre, points[..., 0] - centre), axis=0)


def test_where_polygons_begin_does_not_matter():
    rng = np.random.default_rng(0)
    lines = lines_of([ellipse(first=first) for first in rng.random(20)])
    assert np.ptp(turned(lines), axis=0).max() < np.deg2rad(0.5)


@pytest.mark.parametrize("ratio", [0.5, 0.8])
def test_an_upright_ellipse_is_matched_point_by_point(ratio):
    rng = np.random.default_rng(1)
    lines = lines_of([ellipse(12, 12 * ratio, first=first) for first in rng.random(20)])
    assert np.linalg.norm(np.ptp(lines, axis=0), axis=1).max() < 0.5


def test_a_turning_ellipse_keeps_its_tips_together():
    lines = lines_of([ellipse(14, 7, turn=turn) for turn in np.deg2rad(2) * np.arange(8)])
    radius = np.linalg.norm(lines - 30, axis=2)
    tip, flank = np.argmax(radius[0]), np.argmin(radius[0])
    assert radius[:, tip].min() > 0.96 * 14
    assert radius[:, flank].max() < 1.04 * 7
    # Lines take the shorter way along the surface: they turn with the ellipse, and less than it.
    assert 0 < np.mean(turned(lines)[-1] - turned(lines)[0]) < np.deg2rad(14)


def test_a_turned_tube_has_the_turned_lines():
    outlines = [ellipse(14, 7 + 0.4 * k, turn=0.03 * k) for k in range(9)]
    angle = np.deg2rad(37)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    rotated = lines_of([(points - 30) @ turn.T + 30 for points in outlines])
    assert rotated == pytest.approx((lines_of(outlines) - 30) @ turn.T + 30, abs=1e-6)


def test_a_tube_that_shifts_and_widens_is_not_twisted():
    centres = 30 + 0.4 * np.arange(15)
    lines = lines_of(
        [ellipse(8 + 0.3 * k, 8 + 0.3 * k, (c, 30.0), first=0.37 * k) for k, c in enumerate(centres)]
    )
    arms = lines - np.column_stack([centres, np.full(15, 30.0)])[:, None]
    angle = np.unwrap(np.arctan2(arms[..., 1], arms[..., 0]), axis=0)
    # A rigid turn of one section against the next would show as a mean over all lines.
    assert np.abs(np.mean(angle - angle[:1], axis=1)).max() < np.deg2rad(1)


@hypothesis_settings(deadline=None)
@given(st.lists(st.tuples(st.floats(4, 15), st.floats(0, 0.8), st.floats(0, 1)), min_size=2, max_size=6))
def test_the_order_around_is_kept(shapes):
    outlines = []
    for size, waviness, first in shapes:
        points = ellipse(first=first) - 30
        angle = np.arctan2(points[:, 1], points[:, 0])
        outlines.append(30 + points / 10 * (size * (1 + waviness * np.cos(3 * angle)))[:, None])
    rings, position = align(tube_of(outlines), AROUND, FittingSettings())
    assert rings.shape == (len(shapes), AROUND, 2)
    assert np.all(np.diff(position, axis=1) > 0)
    assert np.all(position[:, -1] - position[:, 0] < 1)


def test_normals_of_a_circle_point_outwards():
    rings = np.stack([ellipse(9, 9, count=64), ellipse(4, 4, count=64)])
    radial = (rings - 30) / np.linalg.norm(rings - 30, axis=2, keepdims=True)
    assert outward_normals(rings) == pytest.approx(radial, abs=1e-3)
    assert np.all(outward_normals(np.full((1, 64, 2), 3.0)) == 0)


def test_fractions_go_around_and_around():
    rings = ellipse(9, 9, count=64)[None]
    at = np.array([[0.1, 0.5, 0.9]])
    assert at_fractions(rings, at + 3) == pytest.approx(at_fractions(rings, at))
    assert at_fractions(rings, np.arange(64)[None] / 64) == pytest.approx(rings)
