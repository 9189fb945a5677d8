"""The spline surface: what must hold whatever the organ is, and shapes whose surface is known."""

import itertools

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.ndimage import binary_dilation, binary_erosion, binary_opening, gaussian_filter, label
from support.shapes import assert_sound, ball, grid, lofted
from support.solids import mesh_of, sphere
from trimesh import creation

import cccd
from cccd.errors import InputError
from cccd.geometry.mesh import Mesh
from cccd.geometry.subdivision import SHARP, ControlMesh
from cccd.surface import spline
from cccd.surface.control_mesh import control_mesh, join_in_pairs, open_edges, split_to_quads, unfold
from cccd.surface.spline import SplineFit, Target

NOWHERE = (-np.inf, np.inf)


def test_thick_slices_of_a_ball():
    mask = ball((60, 60, 12), (30, 30, 6), 20.0, (1.0, 1.0, 5.0))
    surface = lofted(mask, (1.0, 1.0, 5.0))
    assert_sound(surface)
    off = np.abs(np.linalg.norm(surface.vertices - 30, axis=1) - 20)
    assert surface.mesh.vertex_areas @ off / surface.mesh.area < 0.12
    assert off.max() < 1.5  # at the poles, between slices that are 5 mm apart


def folded_area_of_caps(seed):
    """Area in mm^2 of cap triangles that face inwards, of a disc with nine small holes that end."""
    random = np.random.default_rng(seed)
    x, y, z = grid(50, 50, 5)
    mask = np.hypot(x - 25, y - 25) <= 20
    for place in itertools.product((18, 25, 32), (18, 25, 32)):
        at = place + random.uniform(-1, 1, 2)
        mask &= (np.hypot(x - at[0], y - at[1]) > random.uniform(0.6, 2.0)) | (z >= random.integers(1, 4))
    meshes = [body.tessellate(2) for body in lofted(mask, (1.0, 1.0, 3.0)).bodies]
    corners = np.concatenate([mesh.vertices[mesh.faces] for mesh in meshes])
    folded = 0.0
    for height, outwards in ((-1.5, -1), (13.5, 1)):
        cap = corners[np.all(np.abs(corners[..., 2] - height) < 1e-6, axis=1)]
        area = outwards * np.cross(cap[:, 1] - cap[:, 0], cap[:, 2] - cap[:, 0])[:, 2] / 2
        folded -= area[area < 0].sum()
    return folded


@pytest.mark.parametrize("off", [0.0235, 0.0245])
def test_caps_with_small_holes_do_not_fold(off, monkeypatch):
    """Rims of small holes bulge over edges of the cap beside them."""
    monkeypatch.setattr(spline, "OFF_PIXELS", off)
    assert sum(map(folded_area_of_caps, (4, 8))) == 0


def test_a_point_that_was_pulled_over_its_neighbours_unfolds():
    x, y = (axis.ravel() for axis in np.meshgrid(np.arange(5.0), np.arange(5.0), indexing="ij"))
    corner = (5 * np.arange(4)[:, None] + np.arange(4)).ravel()
    quads = corner[:, None] + [0, 5, 6, 1]
    rim = open_edges(quads)
    plane = ControlMesh(np.column_stack([x, y, 0 * x]), quads, rim, np.full(len(rim), SHARP))
    sampler, inner = plane.sampler(), (x % 4 > 0) & (y % 4 > 0)
    folded = plane.vertices + np.where(np.arange(25) == 12, 1, 0)[:, None] * [5.5, 0.3, 0.2]
    normals = np.tile([0.0, 0.0, 1.0], (len(sampler.triangles), 1))

    def least(points):
        return Mesh(sampler.matrix @ points, sampler.triangles).face_normals[:, 2].min()

    flat = unfold(folded, sampler, inner, normals)
    assert least(folded) < 0 < least(flat)
    assert np.array_equal(flat[~inner], folded[~inner])


def test_no_wall_comes_to_look_like_a_cap():
    """A shallow groove in a cap, whose triangles end up with all their corners on the rim."""
    random = np.random.default_rng([2026, 136])
    field = gaussian_filter(random.normal(size=(44, 44, 40)), random.uniform(2.5, 6))
    away = sum(np.meshgrid(*(np.linspace(-1, 1, n) ** 2 for n in field.shape), indexing="ij"))
    field = field / field.std() - 2.5 * away
    mask, _ = label(field > np.quantile(field, 1 - random.uniform(0.05, 0.35)))
    mask = mask == np.bincount(mask.ravel())[1:].argmax() + 1
    mask[[0, -1]] = mask[:, [0, -1]] = False
    share = random.choice([0.1, 0.25, 0.5])
    mask ^= binary_dilation(mask) & ~binary_erosion(mask) & (random.random(mask.shape) < share)
    mask[[0, -1]] = mask[:, [0, -1]] = False
    assert_sound(cccd.reconstruct(mask, np.eye(4)).lofted)


@pytest.mark.parametrize("depth", [1, 3])
def test_a_low_block_that_the_scan_cuts_on_both_sides_keeps_its_walls(depth):
    """Triangles of its walls reach from one cap to the other."""
    x, y, _ = grid(70, 70, depth)
    mask = (np.hypot(x - 35, y - 35) <= 30 + 2 * np.sin(12 * np.arctan2(y - 35, x - 35))) & (
        np.hypot(x - 40, y - 30) > 9
    )
    surface = lofted(mask)
    assert_sound(surface)
    assert surface.mesh.genus == 1
    assert surface.mesh.volume == pytest.approx(mask.sum(), rel=0.001)


def test_what_crosses_in_the_control_mesh_too_evens_out():
    """Points where it began are no cure there: the neighbours' means are."""
    ball = sphere(10.0, subdivisions=3)
    wall, _ = control_mesh(ball, 200, NOWHERE)
    folded = wall.vertices.copy()
    folded[0] *= -6
    fit = SplineFit(wall.moved(folded), Target.of(ball))
    assert len(fit.spline.tessellate(2).self_intersections())
    assert not len(fit.untangle())
    assert not len(fit.spline.tessellate(2).self_intersections())


@settings(max_examples=4, deadline=None)
@given(st.integers(0, 10_000), st.floats(0.6, 2.5), st.sampled_from([1.0, 2.5, 5.0]), st.just((22, 22, 12)))
@example(279, 0.9375, 2.5, (30, 30, 16))  # crosses itself if its control points are rounded as usual
def test_random_blobs_are_closed_and_do_not_pass_through_themselves(seed, width, depth, shape):
    noise = gaussian_filter(np.random.default_rng(seed).normal(size=shape), width)
    mask = binary_opening(noise > np.percentile(noise, 75))
    mask[[0, -1]] = mask[:, [0, -1]] = False
    if not mask.any():
        return
    surface = lofted(mask, (1.0, 1.0, depth))
    assert surface.mesh.is_closed_manifold
    crossing = "intersects itself" in " ".join(surface.report["warnings"])
    assert crossing == (len(surface.mesh.self_intersections()) > 0)  # mended, or said


def blocks(*shape):
    mask = np.zeros((20, 20, 20), bool)
    mask[tuple(slice(4, 4 + size) for size in shape)] = True
    return mask


@pytest.mark.parametrize("shape", [(12, 12, 1), (2, 2, 1), (2, 12, 12)])
def test_as_little_as_two_voxels_across_gives_something_closed(shape):
    surface = lofted(blocks(*shape))
    assert surface.mesh.is_closed_manifold
    assert surface.mesh.volume > 0


@pytest.mark.parametrize("shape", [(1, 1, 1), (12, 1, 12), (1, 1, 12)])
def test_what_has_no_closed_curve_is_refused_in_one_line(shape):
    with pytest.raises(InputError, match=r"^curves: there is no closed curve; [^\n]*$"):
        lofted(blocks(*shape))


def test_quads_keep_the_topology_and_few_corners_are_irregular():
    mesh = mesh_of(creation.torus(10, 3, major_sections=48, minor_sections=24))
    spline, few = control_mesh(mesh, 400, NOWHERE)
    assert spline.tessellate(1).genus == few.genus == 1
    assert np.mean(np.bincount(spline.quads.ravel()) != 4) < 0.25
    assert spline.tessellate(2).is_closed_manifold


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 1000))
def test_every_triangle_is_in_one_polygon_and_every_polygon_becomes_quads(seed):
    ball_of = creation.icosphere(2, 5.0)
    moved = np.array(ball_of.vertices) * (1 + 0.1 * np.random.default_rng(seed).normal(size=(162, 1)))
    mesh = Mesh(moved, np.array(ball_of.faces, np.int64))
    quads, triangles = join_in_pairs(mesh)
    assert 2 * len(quads) + len(triangles) == len(mesh.faces)
    points, split, edges = split_to_quads(mesh.vertices, quads, triangles)
    assert len(split) == 4 * len(quads) + 3 * len(triangles)
    assert len(points) == len(mesh.vertices) + len(edges) + len(quads) + len(triangles)
    halves = np.concatenate([split[:, [0, 1, 2]], split[:, [0, 2, 3]]])
    assert Mesh(points, halves).is_closed_manifold
