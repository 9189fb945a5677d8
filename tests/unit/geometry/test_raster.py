import numpy as np
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from support.shapes import drawn

from cccd.geometry.raster import rasterise


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.booleans())
def test_agrees_with_shapely_on_random_stars(seed, on_lattice):
    rng = np.random.default_rng(seed)
    polygons = []
    for _ in range(3):
        angle = np.sort(rng.random(rng.integers(3, 30))) * 2 * np.pi
        radius = rng.uniform(2, 18, len(angle))
        star = 15 + rng.uniform(-5, 5, 2) + radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
        polygons.append(np.rint(star) if on_lattice else star)
    stack = drawn(polygons, [4, 6, 6]).rasterise((4, 2, 3), (3, 25, 22))
    i, j = np.meshgrid(np.arange(2, 27), np.arange(3, 25), indexing="ij")
    grid = shapely.points(i, j)
    shapes = [shapely.Polygon(polygon) for polygon in polygons]
    usable = [shape.is_valid for shape in shapes]
    if usable[0]:
        assert np.array_equal(stack[0], shapely.intersects(shapes[0], grid))
    assert not stack[1].any()
    if usable[1] and usable[2]:
        a, b = shapes[1:]
        either = shapely.contains(a, grid) ^ shapely.contains(b, grid)
        border = shapely.intersects(a.boundary, grid) | shapely.intersects(b.boundary, grid)
        assert np.array_equal(stack[2], either | border)


def test_a_disc_keeps_its_area_and_outside_parts_are_cut_off():
    angle = np.linspace(0, 2 * np.pi, 7200, endpoint=False)
    disc = 50.3 * np.column_stack([np.cos(angle), np.sin(angle)])
    half = rasterise([disc], (0, -60), (60, 121))
    i, j = np.meshgrid(np.arange(60), np.arange(-60, 61), indexing="ij")
    assert np.array_equal(half, np.hypot(i, j) < 50.3)
    assert not drawn([disc], [9]).rasterise((0, 0, 0), (3, 4, 4)).any()
    assert rasterise([], (0, 0), (2, 3)).shape == (2, 3)
