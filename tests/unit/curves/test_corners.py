import numpy as np
import pytest
from support.known_curves import rectangle
from support.shapes import drawn

from cccd.contours import trace_stack
from cccd.curves.corners import k_cosine, k_cosine_corners, sharp_corners


def naive_k_cosine(points, m):
    """Definition 3, one point and one k at a time."""
    count, cosine, support = len(points), [], []
    m = min(m, (count - 1) // 2)
    for i in range(count):
        c = {}
        for k in range(1, m + 1):
            a, b = points[i] - points[(i + k) % count], points[i] - points[(i - k) % count]
            c[k] = a @ b / np.sqrt((a @ a) * (b @ b))
        k = m
        while k > 1 and c[k - 1] - c[k] > 1e-9:
            k -= 1
        cosine.append(c[k])
        support.append(k)
    return np.array(cosine), np.array(support)


@pytest.mark.parametrize("m", [1, 3, 7, 20, 500])
def test_k_cosine_follows_definition_3_on_ragged_curves(blob, m):
    curves = blob(1)[1]
    cosine, support = k_cosine(curves.points, curves.offsets, m)
    for begin, points in zip(curves.offsets, curves, strict=False):
        expected = naive_k_cosine(points, m)
        assert cosine[begin : begin + len(points)] == pytest.approx(expected[0], abs=1e-12)
        assert np.array_equal(support[begin : begin + len(points)], expected[1])


def test_both_criteria_and_their_windows():
    points, vertices = rectangle(30, 40)
    offsets = np.array([0, len(points)])
    sharpest = k_cosine_corners(points, offsets, 7, "max")
    assert sharpest[vertices].all()
    straightest = k_cosine_corners(points, offsets, 7, "min")
    assert not straightest[vertices].any()
    cosine, support = k_cosine(points, offsets, 7)
    for chosen, sign in ((sharpest, 1), (straightest, -1)):
        for i in np.flatnonzero(chosen):
            near = (i + np.arange(-(support[i] // 2), support[i] // 2 + 1)) % len(points)
            assert sign * cosine[i] >= (sign * cosine[near]).max() - 1e-9
    with pytest.raises(ValueError, match="neither"):
        k_cosine_corners(points, offsets, 7, "best")


def test_sharp_corners_are_corners_of_the_shape_not_of_the_grid(frame):
    points, vertices = rectangle(30, 50)
    found = sharp_corners(points, np.array([0, len(points)]))
    assert np.flatnonzero(found).tolist() == vertices
    away = np.hypot(*(np.indices((200, 200)) - 100))
    discs = trace_stack(np.stack([away < radius + 0.3 for radius in (9, 15, 40, 80)]), (0, 0, 0), frame)
    assert not sharp_corners(discs.points, discs.offsets).any()
    tiny, _ = rectangle(3, 4)
    curves = drawn([tiny, points])
    found = np.flatnonzero(sharp_corners(curves.points, curves.offsets))
    assert (found - len(tiny)).tolist() == vertices
