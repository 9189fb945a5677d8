"""What a surface is measured against, and when it draws a warning."""

import numpy as np
import pytest
import trimesh

from cccd.containers import Curves, Frame, Structure
from cccd.geometry.mesh import Mesh
from cccd.surface.measure import measure_mesh, volume_warnings


def drawn_box(depth: int) -> Structure:
    """Contours of a box of 10 x 20 pixels with a hole of 4 x 4, on ``depth`` slices of 1 x 1 x 3 mm."""
    outer = np.array([(0, 0), (10, 0), (10, 20), (0, 20)], float)
    hole = np.array([(3, 3), (3, 7), (7, 7), (7, 3)], float)
    points = np.concatenate([outer, hole] * depth)
    slices = np.repeat(np.arange(depth), 2).astype(np.int32)
    frame = Frame(np.diag([1.0, 1.0, 3.0, 1.0]), 2, (12, 22, depth))
    offsets = 4 * np.arange(2 * depth + 1)
    curves = Curves(points, offsets, slices, np.tile([False, True], depth), frame)
    return Structure("a", "box", frame, np.zeros(3, int), contours=curves)


@pytest.mark.parametrize(("share", "word"), [(1.0, None), (1.04, None), (0.94, "6% less"), (1.1, "10% more")])
def test_a_surface_that_lost_a_part_draws_a_warning(share, word):
    drawn = (10 * 20 - 4 * 4) * 3 * 5
    box = trimesh.creation.box((drawn * share / 100, 10, 10))
    figures = measure_mesh(Mesh(np.asarray(box.vertices), np.asarray(box.faces)), drawn_box(5))
    assert figures["volume_bias"] == pytest.approx(share - 1)
    warnings = volume_warnings(figures)
    assert len(warnings) == (word is not None)
    assert word is None or word in warnings[0]
