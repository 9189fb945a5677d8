import numpy as np
import pytest

from cccd.containers import Frame
from cccd.contours import trace_stack
from cccd_paper.comparisons.definition_3 import READINGS

FRAME = Frame(np.eye(4), 2, (161, 161, 1))
KS = (3, 5, 7, 12, 20)
AT = np.indices((161, 161)) - 80.0


def chain(mask):
    curves = trace_stack(mask[None], (0, 0, 0), FRAME)
    assert len(curves) == 1
    return curves.points, curves.offsets


def square(half, degrees):
    """A filled square and its four corners."""
    turn = np.radians(degrees)
    axes = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    u, v = np.tensordot(axes, AT, 1)
    corners = np.array([(s, t) for s in (-half, half) for t in (-half, half)]) @ axes + 80
    return (np.abs(u) < half) & (np.abs(v) < half), corners


def disc(radius, middle=(0.0, 0.0)):
    return np.hypot(AT[0] - middle[0], AT[1] - middle[1]) < radius


@pytest.mark.parametrize("name", READINGS)
@pytest.mark.parametrize("k", KS)
def test_a_square_has_its_four_corners_within_a_pixel_whatever_its_turn(name, k):
    for degrees in range(0, 90, 9):
        mask, corners = square(40.3, degrees)
        points, offsets = chain(mask)
        # the chain's own pixels nearest to the corners, which lie up to a pixel outside them
        tips = points[np.linalg.norm(points[:, None] - corners, axis=2).argmin(axis=0)]
        found = points[READINGS[name](points, offsets, k)]
        assert np.abs(found[:, None] - tips).max(axis=2).min(axis=0).max() <= 1


@pytest.mark.parametrize("name", READINGS)
def test_on_a_disc_the_number_falls_with_k_and_not_with_where_the_chain_begins(name):
    points, offsets = chain(disc(60.3))
    counts = [READINGS[name](points, offsets, k).sum() for k in KS]
    assert counts[-1] < counts[2] < counts[0]
    for k, count in zip(KS, counts, strict=True):
        for shift in (1, 17, 100):
            assert READINGS[name](np.roll(points, shift, axis=0), offsets, k).sum() == count


@pytest.mark.parametrize("name", READINGS)
def test_on_a_disc_the_number_hardly_depends_on_how_the_disc_lies(name):
    # a turned disc is the same disc; on another part of a pixel it is another chain
    for k in KS[:3]:
        counts = []
        for turn in np.linspace(0, np.pi / 2, 7):
            middle = 0.45 * np.cos(turn), 0.45 * np.sin(turn)
            counts.append(READINGS[name](*chain(disc(60.3, middle)), k).sum())
        assert max(counts) - min(counts) <= 0.35 * np.mean(counts)


def test_as_printed_every_turn_of_the_chain_is_a_corner_and_rounded_up_it_is_not():
    points, offsets = chain(disc(60.3))
    counts = {name: READINGS[name](points, offsets, 3).sum() for name in READINGS}
    assert counts["as printed"] > 0.3 * len(points)
    assert counts["window rounded up"] < 0.22 * len(points)
    assert counts["smoothed chain"] < 0.22 * len(points)


@pytest.mark.parametrize("name", READINGS)
def test_curves_do_not_influence_each_other(name):
    one, other = chain(disc(20.3))[0], chain(square(15.3, 20)[0])[0]
    offsets = np.array([0, len(one), len(one) + len(other)])
    together = READINGS[name](np.concatenate([one, other]), offsets, 7)
    alone = [READINGS[name](points, np.array([0, len(points)]), 7) for points in (one, other)]
    assert np.array_equal(together, np.concatenate(alone))
