"""Shapes whose right answers are known."""

import numpy as np

from cccd.geometry.polygons import extend_knots


def circle(count: int, radius: float = 40.0, centre: tuple[float, float] = (50.0, 60.0)) -> np.ndarray:
    angle = 2 * np.pi * np.arange(count) / count + 0.1
    return np.array(centre) + radius * np.column_stack([np.cos(angle), np.sin(angle)])


def bean(count: int) -> np.ndarray:
    """A smooth curve with a concavity, sampled evenly by angle."""
    angle = 2 * np.pi * np.arange(count) / count + 0.05
    radius = 40 + 8 * np.cos(angle) + 6 * np.cos(2 * angle) + 3 * np.sin(3 * angle)
    return np.column_stack([60 + radius * np.cos(angle), 70 + radius * np.sin(angle)])


def ring_links(count: int) -> np.ndarray:
    """Links of points that were given in order."""
    pairs = np.sort(np.column_stack([np.arange(count), (np.arange(count) + 1) % count]), axis=1)
    return pairs[np.lexsort(pairs.T[::-1])]


def rectangle(height, width, i=0, j=0):
    """Pixel chain round a filled rectangle, corners at known indices."""
    top = [(i, j + n) for n in range(width)]
    right = [(i + n, j + width) for n in range(height)]
    bottom = [(i + height, j + width - n) for n in range(width)]
    left = [(i + height - n, j) for n in range(height)]
    return np.array(top + right + bottom + left, float), [0, width, width + height, 2 * width + height]


def random_spline(seed, count, repeated=False):
    """Knots and control points of a closed spline, and the generator that made them."""
    rng = np.random.default_rng(seed)
    breaks = np.sort(rng.uniform(0, 10, count))
    if repeated:
        breaks[1:3] = breaks[0]
    return extend_knots(breaks, 10.0), rng.normal(size=(count, 2)), rng
