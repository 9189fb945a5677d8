from dataclasses import replace

import numpy as np
import pytest

from cccd.containers import Frame
from cccd.contours import trace_stack
from cccd_paper.comparisons.tensor_product_loft import TUNED, tensor_product_loft

RADIUS, SLICES, SPACING = 20.3, 9, 4.0


@pytest.fixture(scope="module")
def curves():
    """A cylinder of voxels, slices 4 mm apart, on slices 3 to 11."""
    i, j = np.indices((60, 60)) - 30
    mask = np.broadcast_to(np.hypot(i, j) < RADIUS, (SLICES, 60, 60))
    return trace_stack(mask, (3, 0, 0), Frame(np.diag([1.0, 1.0, SPACING, 1.0]), 2, (60, 60, 15)))


def test_the_tube_of_a_cylinder_has_its_volume(curves):
    mesh = tensor_product_loft(curves)
    height = SPACING * (SLICES - 1 + 2 * TUNED.beyond)
    assert mesh.is_closed_manifold
    assert mesh.genus == 0
    assert mesh.volume == pytest.approx(np.pi * RADIUS**2 * height, rel=0.02)


@pytest.mark.parametrize("beyond", [0.0, 0.25, 0.5])
def test_it_ends_beyond_the_first_and_the_last_slice(curves, beyond):
    mesh = tensor_product_loft(curves, replace(TUNED, beyond=beyond))
    heights = mesh.vertices[:, 2]
    assert heights.min() == pytest.approx(SPACING * (3 - beyond), abs=1e-6)
    assert heights.max() == pytest.approx(SPACING * (11 + beyond), abs=1e-6)


def test_half_a_pixel_outwards_moves_the_whole_outline_by_it(curves):
    through, grown = (
        tensor_product_loft(curves, replace(TUNED, outwards_px=pixels)).vertices for pixels in (0.0, 0.5)
    )
    radii = [np.hypot(*(points[np.abs(points[:, 2] - 28) < 4, :2] - 30).T) for points in (through, grown)]
    assert np.median(radii[1]) - np.median(radii[0]) == pytest.approx(0.5, abs=0.05)


def test_drawn_contours_are_the_border_already(curves):
    drawn = replace(curves, points=curves.points + 0.25)
    low, high = (tensor_product_loft(drawn, replace(TUNED, outwards_px=pixels)) for pixels in (0.0, 0.5))
    assert high.volume == pytest.approx(low.volume)


def test_one_slice_makes_no_surface(curves):
    one = trace_stack(np.ones((1, 5, 5), bool), (0, 2, 2), Frame(np.eye(4), 2, (9, 9, 1)))
    with pytest.raises(ValueError, match="two slices"):
        tensor_product_loft(one)
