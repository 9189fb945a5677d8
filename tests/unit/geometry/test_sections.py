import numpy as np
import pytest
from support.solids import box, sphere

from cccd.geometry.sections import cross_sections

CENTRE = np.array((4.0, -7.0, 11.0))


def test_cut_is_a_circle():
    ball = sphere(15.0, CENTRE)
    normal = np.array((1.0, 2.0, -2.0)) / 3
    heights = CENTRE @ normal + np.array((-30.0, -9.0, 0.0, 12.0))
    sections = cross_sections(ball, normal, heights)
    assert [len(loops) for loops in sections] == [0, 1, 1, 1]
    for offset, (loop,) in zip((-9, 0, 12), sections[1:], strict=True):
        np.testing.assert_allclose(loop @ normal, CENTRE @ normal + offset, atol=1e-9)
        radius = np.linalg.norm(loop - CENTRE - normal * offset, axis=1)
        np.testing.assert_allclose(radius, np.sqrt(225 - offset**2), rtol=0.01)
        steps = np.linalg.norm(np.diff(loop, axis=0, append=loop[:1]), axis=1)
        assert steps.sum() == pytest.approx(2 * np.pi * np.sqrt(225 - offset**2), rel=0.01)


def test_cut_through_vertices_gives_closed_loops():
    sections = cross_sections(box((8, 6, 4)), np.array((0, 0, 1.0)), np.array((-2.0, 0.0, 2.0)))
    lengths = [
        [np.linalg.norm(np.diff(loop, axis=0, append=loop[:1]), axis=1).sum() for loop in loops]
        for loops in sections
    ]
    assert lengths[1] == [pytest.approx(28)]
