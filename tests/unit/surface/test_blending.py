import numpy as np
import pytest
from scipy import ndimage
from shapes import SETTINGS, ball, curves_of, grid
from skimage.measure import marching_cubes

from cccd.geometry.mesh import Mesh
from cccd.geometry.raster import voxelise
from cccd.surface import loft_surface
from cccd.surface.blending import blend, blend_weights, zero_surface
from cccd.surface.booleans import Nesting
from cccd.surface.fields import LevelField
from cccd.surface.solid import _strayed
from cccd.surface.target import TargetField
from cccd.surface.union import unite_on_grid

NOWHERE = np.zeros((0, 3))


def sphere_mesh(radius=8.0):
    x, y, z = grid(30, 30, 30) - 14.5
    vertices, faces, _, _ = marching_cubes(np.sqrt(x * x + y * y + z * z) - radius, 0.0)
    radii = np.linalg.norm(vertices - 14.5, axis=1, keepdims=True)
    return Mesh(14.5 + (vertices - 14.5) * radius / radii, faces.astype(np.int64))


def sphere_grid(cell, radius=8.0):
    return unite_on_grid([sphere_mesh(radius)], [Nesting(0, False)], cell)[0]


def sphere_target(radius):
    """Distance to a sphere, known everywhere."""
    return lambda points, within: (np.linalg.norm(points - 14.5, axis=1) - radius, np.full(len(points), 99.0))


def unknown(points, within):
    return np.zeros(len(points)), np.zeros(len(points))


def weights_of(sphere, seam, reach, share=0.0, everywhere=0.0):
    settings = SETTINGS.blending.model_copy(update={"wall_share": share})
    return blend_weights(sphere, seam, reach, everywhere, settings)


def cone(spacing=(0.8, 1.2), slope=0.15, knot=1.9):
    """A target whose distance is known: round discs that shrink with height."""
    i, j = np.indices((50, 40))
    plane = np.hypot((i - 25) * spacing[0], (j - 20) * spacing[1]) - 12
    fields = [LevelField(2.0 * k, (plane + slope * 2 * k).astype(np.float32), k) for k in range(5)]
    return TargetField.of(fields, np.array(spacing), 10.0, knot)


@pytest.mark.parametrize("cell", [0.7, 1.3])
def test_the_zero_level_of_a_sphere_is_a_sphere(cell):
    sphere = sphere_grid(cell)
    distance = blend(sphere, blend_weights(sphere, NOWHERE, 5.0, 0.0, SETTINGS.blending), unknown, 2.0)
    mesh = zero_surface(distance)
    assert mesh.is_closed_manifold
    assert len(mesh.self_intersections()) == 0
    assert np.linalg.norm(mesh.vertices - 14.5, axis=1) == pytest.approx(8, abs=0.08)
    assert mesh.volume == pytest.approx(4 / 3 * np.pi * 8**3, rel=0.03)


def test_the_target_rules_at_seams_and_nowhere_else():
    seam = np.array([[14.5, 14.5, 22.5]])
    mesh = zero_surface(
        blend(sphere_grid(0.8), weights_of(sphere_grid(0.8), seam, 8.0), sphere_target(9.0), 2.0)
    )
    radius = np.linalg.norm(mesh.vertices - 14.5, axis=1)
    away = np.linalg.norm(mesh.vertices - seam, axis=1)
    assert radius[away < 3] == pytest.approx(9, abs=0.05)
    assert radius[away > 9] == pytest.approx(8, abs=0.05)
    assert mesh.is_closed_manifold


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
def test_the_target_has_its_share_in_walls_and_none_on_top(share):
    sphere = sphere_grid(0.8)
    mesh = zero_surface(blend(sphere, weights_of(sphere, NOWHERE, 8.0, share), sphere_target(8.4), 2.0))
    away = mesh.vertices - 14.5
    radius = np.linalg.norm(away, axis=1)
    tilt = np.abs(away[:, 2]) / radius
    assert radius[tilt < 0.35] == pytest.approx(8 + 0.4 * share, abs=0.05)
    assert radius[tilt > 0.85] == pytest.approx(8, abs=0.05)
    assert mesh.is_closed_manifold


def test_a_target_that_knows_more_than_the_tubes_rules_everywhere():
    sphere = sphere_grid(0.8)
    mesh = zero_surface(
        blend(sphere, weights_of(sphere, NOWHERE, 8.0, everywhere=1.0), sphere_target(8.6), 2.0)
    )
    assert np.linalg.norm(mesh.vertices - 14.5, axis=1) == pytest.approx(8.6, abs=0.05)


def test_a_target_that_reaches_beyond_the_grid_leaves_the_mesh_closed():
    def everywhere(points, within):
        return np.full(len(points), -5.0), np.full(len(points), 99.0)

    seam = np.array([[14.5, 14.5, 22.5]])
    mesh = zero_surface(blend(sphere_grid(0.8), weights_of(sphere_grid(0.8), seam, 20.0), everywhere, 2.0))
    assert mesh.is_closed_manifold
    assert mesh.volume > 4 / 3 * np.pi * 8**3


def test_what_strays_from_the_target_is_told_from_a_flat_top():
    """On the top of a disc the distance in the plane is large, and the boundary near."""

    def disc(points, within):
        away = np.hypot(points[:, 0], points[:, 1])
        return np.where(np.abs(points[:, 2]) < 8, away - 20, away + 20), np.ones(len(points))

    vertices = np.array([(0, 0, 7.5), (20, 0, 0), (22, 0, 7.5), (40, 0, 0), (0, 0, 0), (0, 0, 6)], float)
    assert _strayed(vertices, disc, 3.0).tolist() == [[40, 0, 0], [0, 0, 0]]


@pytest.mark.parametrize("knot", [1.9, 2.0, 2.5])
def test_a_target_returns_distances_and_how_far_they_reach(knot):
    rng = np.random.default_rng(0)
    angle, radius = rng.uniform(0, 2 * np.pi, 60), rng.uniform(6, 14, 60)
    points = np.column_stack(
        [20 + radius * np.cos(angle), 24 + radius * np.sin(angle), rng.uniform(0.1, 7.9, 60)]
    )
    distance, room = cone(knot=knot)(points)
    assert distance == pytest.approx(radius - 12 + 0.15 * points[:, 2], abs=0.06)
    assert room == pytest.approx(np.minimum(points[:, 2], 8 - points[:, 2]))


def test_a_target_of_wider_knots_takes_more_of_the_pixels_steps_off():
    i, j = np.indices((60, 60))
    mask = (i - 29.7) * 0.3 + (j - 30) < 0  # a straight edge: what is left of its steps is noise
    plane = ndimage.distance_transform_edt(~mask) - ndimage.distance_transform_edt(mask)
    fields = [LevelField(float(k), (plane / 2).astype(np.float32), k) for k in range(30)]
    at = np.linspace(15, 45, 200)
    points = np.column_stack([at, 30 - 0.3 * (at - 29.7), np.full(200, 15.0)])
    rough, smooth = (TargetField.of(fields, np.ones(2), 9.0, knot)(points)[0].std() for knot in (2.0, 2.5))
    assert smooth < 0.8 * rough
    assert rough < 0.1


def test_a_target_says_nothing_beyond_its_levels_and_in_wide_gaps():
    whole = cone()
    split = TargetField(
        [*whole.planes, *whole.planes], np.r_[whole.z, whole.z + 30], whole.spacing, 10.0, whole.knot
    )
    points = np.array([[20, 24, -1.0], [20, 24, 20.0], [20, 24, 39.0], [20, 24, 4.0]])
    assert split(points)[1].tolist() == [0, 0, 0, 4]


def test_small_parts_are_left_out_with_a_warning():
    mask = ball()
    mask[2:4, 2:4, 30] = True
    surface = loft_surface(curves_of(mask), SETTINGS)
    assert surface.report["bodies"] == 1
    assert any("fewer than 6 voxels" in warning for warning in surface.report["warnings"])
    assert loft_surface(curves_of(ball()), SETTINGS).report["warnings"] == []


def test_caps_end_where_the_last_slices_point():
    spacing = (2.0, 2.0, 5.0)
    mask = ball((40, 40, 24), (20, 20, 12.1), 30, spacing)
    surface = loft_surface(curves_of(mask, spacing), SETTINGS)
    assert surface.vertices[:, 2].min() == pytest.approx(5 * 12.1 - 30, abs=1.0)
    assert surface.vertices[:, 2].max() == pytest.approx(5 * 12.1 + 30, abs=1.0)


def test_an_open_vessel_runs_through_the_cut_end():
    x, y, z = grid(50, 50, 16)
    mask = (np.hypot(x - 25, y - 25) <= 20) & (z < 16)
    mask &= ~((np.hypot(x - 25, y - 36) <= 4) & (z > 0))
    mask &= ~((np.abs(x - 25) <= 3) & (y > 34) & (z == 0))  # in the first slice it reaches the outside
    surface = loft_surface(curves_of(mask), SETTINGS)
    assert surface.mesh.is_closed_manifold
    inside = voxelise(surface.mesh, surface.frame.affine, mask.shape)
    assert not inside[25, 36].any()
