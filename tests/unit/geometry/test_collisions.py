"""Triangles that pass through each other: found again where they moved, and nowhere else."""

import numpy as np
import pytest

from cccd.geometry.collisions import MovingTriangles, passing_pairs


def found(pairs):
    return sorted(map(tuple, np.sort(pairs, axis=1).tolist()))


@pytest.fixture
def scattered():
    """Vertices (180, 3) and 60 triangles of which many pass through others."""
    rng = np.random.default_rng(1)
    middles = rng.uniform(0, 4, (60, 1, 3))
    vertices = (middles + rng.uniform(-1, 1, (60, 3, 3))).reshape(-1, 3)
    return vertices, np.arange(180).reshape(60, 3)


def test_chosen_triangles_have_all_their_pairs_and_no_others(scattered):
    chosen = np.arange(60) % 7 == 0
    whole = passing_pairs(*scattered)
    assert len(whole) > 20
    assert found(passing_pairs(*scattered, chosen)) == found(whole[chosen[whole].any(axis=1)])


def test_triangles_that_move_a_few_at_a_time_have_the_pairs_of_all_of_them(scattered):
    vertices, faces = scattered
    moving, rng = MovingTriangles(faces), np.random.default_rng(2)
    counts = set()
    for _ in range(6):
        pairs = moving.passing_pairs(vertices)
        assert found(pairs) == found(passing_pairs(vertices, faces))
        counts.add(len(pairs))
        vertices[rng.choice(180, 9)] += rng.normal(0, 0.5, (9, 3))  # in place, as callers may
    assert len(counts) > 1


@pytest.mark.parametrize("seed", range(4))
def test_few_that_move_among_thousands_of_all_sizes_have_the_pairs_of_all_of_them(seed):
    rng = np.random.default_rng(seed)
    sizes = rng.choice([0.5, 1, 6], (3000, 1, 1), p=[0.6, 0.39, 0.01])
    vertices = (rng.uniform(0, 30, (3000, 1, 3)) + sizes * rng.uniform(-1, 1, (3000, 3, 3))).reshape(-1, 3)
    faces, counts = np.arange(9000).reshape(3000, 3), set()
    moving = MovingTriangles(faces)
    for way in (0.0, 0.3, 5.0, 100.0):  # the last ones leave the others' box
        vertices[rng.choice(9000, 12)] += rng.normal(0, way, (12, 3))
        pairs = moving.passing_pairs(vertices)
        assert found(pairs) == found(passing_pairs(vertices, faces))
        counts.add(len(pairs))
    assert min(counts) > 100
    assert len(counts) > 1
