from dataclasses import replace

import numpy as np
import pytest
from shapes import curves_of

from cccd.containers import Sections
from cccd.geometry.mesh import Mesh
from cccd.settings.surface import LoftSettings
from cccd.surface import loft_surface
from cccd.surface.fields import LevelField
from cccd.surface.moving_sheets import find_middle_line, follow, move_sheets

SHAPE, PIXEL, GAP = (60, 50), np.array([0.75, 0.75]), 5.0


def slit(middle, half_width=2.0, tilt=0.0):
    """Distances to a slit across everything, which turns by ``tilt`` radians from the columns' direction."""
    i, j = np.indices(SHAPE) * 0.75
    away = (i - middle) * np.cos(tilt) + (j - 18) * np.sin(tilt)
    return np.float32(half_width - np.abs(away))


def stack(below, above, parts=4):
    """Two slices and levels between them, interpolated as they lie."""
    shares = np.arange(parts + 1) / parts
    return [
        LevelField(GAP * share, (1 - share) * below + share * above, {0: 0, 1: 1}.get(share))
        for share in shares.astype(np.float32)
    ]


@pytest.mark.parametrize("sign", [1, -1])  # a slit, and a plate
@pytest.mark.parametrize("tilt", [0.0, 0.5])
def test_a_sheet_that_moves_by_more_than_its_width_is_where_it_should_be_between_the_slices(sign, tilt):
    fields = stack(sign * slit(19.0, tilt=tilt), sign * slit(25.5, tilt=tilt))
    inner = (slice(8, -8), slice(8, -8))
    moved = move_sheets(fields, PIXEL)
    for n in (1, 2, 3):
        true = sign * slit(19.0 + 6.5 * n / 4, tilt=tilt)[inner]
        near = np.abs(true) < 1.5
        assert np.abs(moved[n].distance[inner] - true)[near].max() < 0.02


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("upwards", [True, False])
def test_a_sheet_that_opens_between_two_slices_keeps_its_width_and_what_it_parts_apart(sign, upwards):
    x = np.float32(np.indices(SHAPE)[0] * 0.75)
    first, second = (sign * np.maximum(x - 24, slit(12 + 1.3 * z)) for z in (0, GAP))
    last = sign * (x - 23)  # the slit's one wall: the other one would lie at 27, and the organ ends at 24
    fields = [*stack(first, second), *(replace(f, z=f.z + GAP) for f in stack(second, last)[1:])]
    fields = [replace(field, source_slice=None if n % 4 else n // 4) for n, field in enumerate(fields)]
    if not upwards:
        fields = [replace(field, z=2 * GAP - field.z) for field in fields[::-1]]
    moved = move_sheets(fields, PIXEL)
    for field in moved:
        z = field.z if upwards else 2 * GAP - field.z
        if 0 < z < 2 * GAP:
            true = slit(12 + 1.3 * z)[:, 8:-8]
            beside = (x[:, 8:-8] < 12 + 1.3 * z) & (np.abs(true) < 1.5)
            assert np.abs(sign * field.distance[:, 8:-8] - true)[beside].max() < 0.1
            assert (sign * field.distance[:, 8:-8][true > 1]).min() > 0


def test_a_slit_that_ends_within_the_organ_between_two_slices_is_interpolated_as_it_lies():
    whole = np.full(SHAPE, -4, np.float32)
    fields = [
        *stack(slit(12.0), slit(18.5)),
        *(replace(f, z=f.z + GAP) for f in stack(slit(18.5), whole)[1:]),
    ]
    fields = [replace(field, source_slice=None if n % 4 else n // 4) for n, field in enumerate(fields)]
    for before, after in zip(fields[4:], move_sheets(fields, PIXEL)[4:], strict=True):
        np.testing.assert_array_equal(after.distance, before.distance)


def test_slices_stay_and_so_does_what_overlaps_itself_or_only_grows():
    for below, above in (
        (slit(19.0), slit(20.5)),
        (slit(19.0, 2.0), slit(21.0, 4.0)),
        (slit(9.0), slit(30.0)),
    ):
        fields = stack(below, above)
        for before, after in zip(fields, move_sheets(fields, PIXEL), strict=True):
            np.testing.assert_array_equal(after.distance, before.distance)
    fields = stack(slit(19.0), slit(25.0))
    moved = move_sheets(fields, PIXEL)
    assert moved[0] is fields[0]
    assert moved[-1] is fields[-1]
    wall = [np.float32(np.indices(SHAPE)[0] * 0.75 - middle) for middle in (19.0, 25.0)]
    fields = stack(*wall)
    assert move_sheets(fields, PIXEL) == fields


def test_ways_up_and_down_are_each_other_s_reverse():
    low, high = (find_middle_line(slit(middle, tilt=0.3), PIXEL, GAP) for middle in (19.0, 24.0))
    np.testing.assert_allclose(low.half_widths, 2, atol=0.3)
    square = 5 * np.cos(0.3) * np.array([np.cos(0.3), np.sin(0.3)])
    for line, other, way in ((low, high, square), (high, low, -square)):
        chosen, onto = follow(line, other, 8.0, 0.75)
        assert len(chosen) > 0.7 * len(line.points)
        np.testing.assert_allclose((other.points[onto] - line.points[chosen]).mean(axis=0), way, atol=0.3)


def cut_block():
    """A block of 5 mm slices that an oblique slit cuts in two from its lowest slice to its highest."""
    i, j, k = np.indices((90, 40, 12)) - np.array([45, 20, 6])[:, None, None, None]
    block = (np.abs(i) < 36) & (np.abs(j) < 15) & (np.abs(k) < 4)
    return block & (np.abs(i - 6 * (k + 0.5)) > 2)


def euler(mesh: Mesh) -> int:
    edges = np.unique(np.sort(mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)
    return len(mesh.vertices) - len(edges) + len(mesh.faces)


def test_a_block_that_an_oblique_slit_cuts_is_two_balls_without_handles():
    curves = curves_of(cut_block(), spacing=(1.0, 1.0, 5.0))
    assert euler(loft_surface(Sections(curves), LoftSettings()).mesh) == 4
