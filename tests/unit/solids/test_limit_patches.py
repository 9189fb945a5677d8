"""Patches of Catmull-Clark surfaces: exact where the surface is a spline, and near to it elsewhere."""

import numpy as np
import pytest
from scipy.interpolate import BSpline
from scipy.spatial import cKDTree
from support.control_meshes import bumpy, cube, pill, torus, torus_grid

from cccd.geometry.subdivision import SHARP
from cccd_solids.limit_patches import HalfEdges, LimitPatches, bernstein, settled


def away_from(points, others):
    return cKDTree(others).query(points)[0]


def normals_at_corners(nets):
    """Of every patch at its corner 0."""
    across = np.cross(nets[:, 0, 1] - nets[:, 0, 0], nets[:, 1, 0] - nets[:, 0, 0])
    return across / np.linalg.norm(across, axis=1, keepdims=True)


def test_half_edges_go_around_their_vertices():
    links = HalfEdges.of(bumpy())
    at = np.arange(len(links.twin))
    for _ in range(12):
        at = links.around[at]
        assert np.array_equal(links.origin[at], links.origin)
    assert np.array_equal(links.back[links.around], np.arange(len(at)))
    assert np.array_equal(links.twin[links.twin], np.arange(len(at)))
    assert np.array_equal(links.origin[links.following], links.origin[links.twin])


def test_a_torus_is_scipys_bicubic_spline():
    grid = torus_grid()
    patches = LimitPatches.of(torus())
    u = np.linspace(0, 1, 6)
    knots = [np.arange(n + 7) - 3 for n in grid.shape[:2]]
    wrapped = np.concatenate([grid[-1:], grid, grid[:2]])
    wrapped = np.concatenate([wrapped[:, -1:], wrapped, wrapped[:, :2]], axis=1)
    for row, column in ((0, 0), (3, 5), (8, 13)):
        across = BSpline(knots[0], wrapped, 3)(row + u)
        wanted = BSpline(knots[1], across.transpose(1, 0, 2), 3)(column + u)
        found = patches.samples(6)[row * grid.shape[1] + column]
        assert found == pytest.approx(wanted, abs=1e-9)
    assert patches.jumps().max() < 1e-5
    assert np.array_equal(patches.eased().inner, patches.inner)


@pytest.mark.parametrize("mesh", [bumpy(), bumpy(flat=True), pill(), pill().subdivided(), cube(SHARP)])
def test_patches_are_the_limit_surface_wherever_it_is_regular(mesh):
    patches = LimitPatches.of(mesh).eased()
    regular = patches.links.regular.reshape(-1, 4).all(axis=1)
    fine = mesh.tessellate(3).vertices
    if regular.any():
        assert away_from(patches.samples(9)[regular].reshape(-1, 3), fine).max() < 1e-9
    assert away_from(patches.nets[:, [0, 0, 3, 3], [0, 3, 0, 3]].reshape(-1, 3), fine).max() < 1e-9


def test_a_cube_is_flat_patches():
    patches = LimitPatches.of(cube(SHARP))
    assert np.abs(patches.samples(5)).max(axis=-1) == pytest.approx(1.0)
    even = np.linspace(-1, 1, 4)
    assert np.sort(np.unique(patches.nets.round(12))) == pytest.approx(even)


def test_tangent_planes_at_corners_are_the_limits():
    """Two steps finer they are the same: only the limit's own plane stays."""
    mesh = bumpy()
    fine = mesh.subdivided(2)
    wanted = LimitPatches.of(fine)
    count = len(mesh.quads)
    normals = normals_at_corners(LimitPatches.of(mesh).nets)
    small = normals_at_corners(wanted.nets)[np.arange(count)]  # the first child of each first child
    assert np.degrees(np.arccos(np.clip(np.vecdot(normals, small), -1, 1))).max() < 1e-5
    assert wanted.corners[: len(mesh.vertices)] == pytest.approx(LimitPatches.of(mesh).corners, abs=1e-9)


def test_the_plane_beside_a_crease_is_the_limits():
    mesh = bumpy(flat=True)
    patches = LimitPatches.of(mesh)
    links = patches.links
    kept = (links.creases[::4] == 2) & ~links.sharp[::4]
    assert (sum(links.sector)[::4][kept] > 2).any()
    fine = LimitPatches.of(mesh.subdivided(2))
    normals, small = (normals_at_corners(nets)[: len(mesh.quads)] for nets in (patches.nets, fine.nets))
    assert np.degrees(np.arccos(np.clip(np.vecdot(normals, small), -1, 1)))[kept].max() < 1e-5


@pytest.mark.parametrize("mesh", [bumpy(), bumpy(2), bumpy(flat=True), cube().subdivided()])
def test_easing_takes_jumps_away_and_stays_near(mesh):
    plain = LimitPatches.of(mesh)
    eased = plain.eased()
    assert eased.jumps().mean() < plain.jumps().mean() / 2
    assert np.percentile(eased.jumps(), 99) < np.percentile(plain.jumps(), 99) / 2
    size = np.linalg.norm(np.diff(plain.nets[:, 0, [0, 3]], axis=1), axis=-1).mean()
    assert np.abs(eased.inner - plain.inner).max() < 0.15 * size  # and the surface moves by a seventh of that
    assert np.array_equal(eased.inner[plain.links.regular], plain.inner[plain.links.regular])


def test_neighbours_share_the_points_of_their_edges():
    mesh = bumpy(flat=True)
    patches = LimitPatches.of(mesh).eased().rounded(1e-4, np.zeros(len(mesh.vertices), np.bool_))
    sides = np.stack([np.rot90(patches.nets, k, axes=(1, 2))[:, 0] for k in range(4)], 1).reshape(-1, 4, 3)
    assert np.array_equal(sides, sides[patches.links.twin][:, ::-1])


def test_rounded_patches_join_as_smoothly_and_have_few_digits():
    patches = LimitPatches.of(torus())
    rounded = patches.rounded(1e-4, np.zeros(len(patches.corners), np.bool_))
    assert 0 < np.abs(rounded.nets - patches.nets).max() < 3e-4
    assert np.abs(rounded.nets * 1e4 - np.round(rounded.nets * 1e4)).max() < 1e-6
    assert rounded.jumps().max() < 1e-4


def test_edges_that_are_sharp_for_some_steps_only_are_settled_first():
    mesh = settled(cube(1.5))
    assert np.all(mesh.sharpness >= SHARP)
    assert len(mesh.quads) == 6 * 16


def test_bernstein_polynomials_and_slopes():
    at = np.linspace(0, 1, 7)
    assert bernstein(at).sum(axis=1) == pytest.approx(1)
    step = 1e-6
    slopes = (bernstein(at + step) - bernstein(at - step)) / (2 * step)
    assert bernstein(at, True) == pytest.approx(slopes, abs=1e-8)
