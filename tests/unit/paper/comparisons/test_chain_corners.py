import numpy as np
import pytest
from support.known_curves import rectangle

from cccd_paper.comparisons.chain_corners import DETECTORS


@pytest.mark.parametrize("name", DETECTORS)
def test_detectors_find_a_rectangle_s_corners_wherever_it_starts(name):
    points, vertices = rectangle(40, 60)
    for shift in (0, 17, 60):
        moved = np.roll(points, -shift, axis=0)
        found = DETECTORS[name](moved, np.array([0, len(points)]))
        for vertex in points[vertices]:
            assert np.linalg.norm(moved[found] - vertex, axis=1).min() == 0


@pytest.mark.parametrize("name", [name for name in DETECTORS if name != "k-cosine"])
def test_detectors_leave_straight_sides_alone(name):
    points, vertices = rectangle(40, 60)
    found = DETECTORS[name](points, np.array([0, len(points)]))
    away = np.linalg.norm(points[found][:, None] - points[vertices][None], axis=2).min(axis=1)
    assert away.max() == 0


@pytest.mark.parametrize("name", DETECTORS)
def test_detectors_treat_each_curve_alone(name, blob):
    curves = blob(5, slices=3)[1]
    together = DETECTORS[name](curves.points, curves.offsets)
    alone = [DETECTORS[name](points, np.array([0, len(points)])) for points in curves]
    assert np.array_equal(together, np.concatenate(alone))
