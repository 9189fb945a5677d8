import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cccd.geometry.flat_caps import between_planes, fill_rim
from cccd.geometry.grid import ScalarGrid


def rim_of(*polygons):
    """Points and sides of closed polygons, outlines counter-clockwise and holes clockwise."""
    starts = np.cumsum([0, *map(len, polygons)])
    number = [np.arange(len(part)) + start for part, start in zip(polygons, starts, strict=False)]
    return np.concatenate(polygons), np.concatenate([np.column_stack([n, np.roll(n, -1)]) for n in number])


def circle(radius, count, way=1):
    angle = way * 2 * np.pi * np.arange(count) / count
    return radius * np.column_stack([np.cos(angle), np.sin(angle)])


def doubled_areas(corners):
    """Twice the area (T,) of triangles (T, 3, 2), positive where they run counter-clockwise."""
    return np.linalg.det(corners[:, 1:] - corners[:, :1])


@given(st.integers(12, 60), st.floats(0.2, 0.7))
def test_a_rim_with_a_hole_is_filled_between_both(count, share):
    points, rim = rim_of(circle(10, count), circle(10 * share, count, -1))
    triangles = fill_rim(points, rim)
    doubled = doubled_areas(points[triangles])
    assert np.all(doubled > 0)
    area = count / 2 * np.sin(2 * np.pi / count) * 100 * (1 - share**2)
    assert doubled.sum() / 2 == pytest.approx(area, rel=1e-6)
    sides = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    once, times = np.unique(sides, axis=0, return_counts=True)
    beside = dict(zip(map(tuple, once.tolist()), times.tolist(), strict=True))
    assert all(beside[tuple(sorted(side))] == 1 for side in rim.tolist())
    assert np.all(times <= 2)


def test_a_rim_of_long_sides_is_spanned():
    points, rim = rim_of(np.array([(0.0, 0), (30, 0), (30, 1), (0, 1)]))
    assert doubled_areas(points[fill_rim(points, rim)]).sum() / 2 == pytest.approx(30)


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10**6), st.floats(-3, 3))
def test_whatever_a_plane_cuts_is_closed_and_does_not_pass_through_itself(seed, height):
    rng = np.random.default_rng(seed)
    points = np.stack(np.meshgrid(*[np.arange(-12, 12.1, 0.6)] * 3, indexing="ij"), -1)
    centres, radii = rng.uniform(-7, 7, (6, 3)), rng.uniform(2, 4, 6)
    values = np.min(
        [np.linalg.norm(points - c, axis=-1) - r for c, r in zip(centres, radii, strict=True)], axis=0
    )
    whole = ScalarGrid.uniform(values, (-12, -12, -12), 0.6).isosurface(0.0)
    below, above = between_planes(whole, -np.inf, height), between_planes(whole, height, np.inf)
    assert below.volume + above.volume == pytest.approx(whole.volume, rel=1e-9)
    for part in (below, above):
        assert len(part.faces) == 0 or part.is_closed_manifold
        assert len(part.self_intersections()) == 0


@pytest.mark.parametrize("turn", [0.3, 1.0])
def test_a_rim_of_three_sides_is_one_triangle(turn):
    angle = turn + 2 * np.pi * np.arange(3) / 3
    assert len(fill_rim(*rim_of(np.column_stack([np.cos(angle), np.sin(angle)])))) == 1
