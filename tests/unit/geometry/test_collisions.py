"""Triangles that pass through each other: found again where they moved, and nowhere else."""

import numpy as np
import pytest
from trimesh import creation

from cccd.geometry.collisions import MovingTriangles, may_cross, passing_pairs


def found(pairs):
    return sorted(map(tuple, np.sort(pairs, axis=1).tolist()))


def test_chosen_triangles_have_all_their_pairs_and_no_others():
    rng = np.random.default_rng(1)
    middles = rng.uniform(0, 4, (60, 1, 3))
    scattered = (middles + rng.uniform(-1, 1, (60, 3, 3))).reshape(-1, 3), np.arange(180).reshape(60, 3)
    chosen = np.arange(60) % 7 == 0
    whole = passing_pairs(*scattered)
    assert len(whole) > 20
    assert found(passing_pairs(*scattered, chosen)) == found(whole[chosen[whole].any(axis=1)])


@pytest.mark.parametrize("seed", range(4))
def test_few_that_move_among_thousands_of_all_sizes_have_the_pairs_of_all_of_them(seed):
    rng = np.random.default_rng(seed)
    sizes = rng.choice([0.5, 1, 6], (3000, 1, 1), p=[0.6, 0.39, 0.01])
    vertices = (rng.uniform(0, 30, (3000, 1, 3)) + sizes * rng.uniform(-1, 1, (3000, 3, 3))).reshape(-1, 3)
    faces, counts = np.arange(9000).reshape(3000, 3), set()
    moving = MovingTriangles(faces)
    for way in (0.0, 0.3, 5.0, 100.0):  # the last ones leave the others' box
        vertices[rng.choice(9000, 12)] += rng.normal(0, way, (12, 3))  # in place, as callers may
        pairs = moving.passing_pairs(vertices)
        assert found(pairs) == found(passing_pairs(vertices, faces))
        counts.add(len(pairs))
    assert min(counts) > 100
    assert len(counts) > 1


def dented(seed):
    """Vertices and faces of bodies that run into each other and are dented, twisted or torn."""
    rng, parts = np.random.default_rng(seed), []
    for _ in range(3):
        body = creation.torus(6, 2, 60, 30) if rng.random() < 0.5 else creation.icosphere(4, 5)
        parts.append(body.apply_translation(rng.uniform(-6, 6, 3)))
    vertices = np.concatenate([part.vertices for part in parts])
    starts = np.cumsum([0, *(len(part.vertices) for part in parts[:-1])])
    faces = np.concatenate([part.faces + start for part, start in zip(parts, starts, strict=True)])
    for _ in range(4):
        away = vertices - vertices[rng.integers(len(vertices))]
        weight = np.exp(-(away**2).sum(axis=1) / rng.uniform(0.5, 4) ** 2)
        turn = weight * rng.normal(0, 2)
        vertices[:, :2] += away[:, 1::-1] * np.column_stack([np.sin(turn), -np.sin(turn)])
        vertices += weight[:, None] * rng.normal(0, 3, 3)
    chosen = rng.choice(len(faces), 40, replace=False)
    if seed % 3 == 1:
        faces[chosen] = faces[chosen, ::-1]
    return vertices, np.delete(faces, chosen, axis=0) if seed % 3 == 2 else faces


@pytest.mark.parametrize("seed", range(6))
def test_smooth_patches_hide_no_pair_that_passes_through(seed):
    vertices, faces = dented(seed)
    pairs = passing_pairs(vertices, faces)
    assert 0 < may_cross(vertices, faces).mean() < 0.9
    assert len(pairs) > 50
    assert found(pairs) == found(passing_pairs(vertices, faces, np.ones(len(faces), bool)))


def test_sheets_that_touch_in_a_vertex_and_pass_through_each_other_beside_it_are_found():
    steps = np.arange(-6, 7)
    rows, columns = np.meshgrid(steps, steps, indexing="ij")
    first = np.column_stack([rows.ravel(), columns.ravel(), np.zeros(rows.size)])
    corner = np.arange(rows.size).reshape(rows.shape)
    a, b, c, d = (
        part.ravel() for part in (corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:])
    )
    faces = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    tilted = first @ np.array([(0.8, 0.6, 0.16), (-0.6, 0.8, 0.12), (0, 0, 1)])
    middle = rows.size // 2
    joined = np.where(faces == middle, middle, faces + rows.size)
    vertices, both = np.concatenate([first, tilted]), np.concatenate([faces, joined])
    pairs = passing_pairs(vertices, both)
    assert len(pairs) > 10
    assert found(pairs) == found(passing_pairs(vertices, both, np.ones(len(both), bool)))


def test_hardly_a_triangle_of_a_smooth_body_needs_a_closer_look():
    body = creation.torus(10, 3, 200, 80)
    assert may_cross(np.array(body.vertices), np.array(body.faces, np.int64)).mean() < 0.1
