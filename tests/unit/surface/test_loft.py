import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy.ndimage import binary_opening, gaussian_filter
from scipy.spatial.transform import Rotation
from support.refusals import refusal
from support.shapes import SETTINGS, assert_sound, ball, curves_of, drawn, grid, lofted, structure_of

from cccd.containers import Sections
from cccd.contours import trace_contours
from cccd.geometry.raster import dice, voxelise
from cccd.surface.loft import loft_surface
from cccd_workflow.surface_measures import measure_surface


def agreement(surface, mask):
    return dice(mask, voxelise(surface.mesh, surface.frame.affine, mask.shape))


def rough_organ(seed):
    """A tilted ellipsoid of some 900 voxels with a border as rough as drawn ones are."""
    points = np.stack(grid(40, 40, 40), -1) - [20.2, 19.7, 20.4]
    turned = points @ Rotation.from_euler("xyz", (0.4, 0.7, 0.2)).as_matrix()
    noise = gaussian_filter(np.random.default_rng(seed).normal(size=(40, 40, 40)), 1.0)
    return binary_opening(np.linalg.norm(turned / (4.2, 5.3, 9.6), axis=-1) + 0.1 * noise / noise.std() < 1)


def test_small_rough_organs_keep_their_volume():
    """Smoothing takes teeth off and fills notches: on the mean neither may win."""
    masks = [rough_organ(seed) for seed in range(4)]
    kept = [lofted(mask).mesh.volume / mask.sum() for mask in masks]
    assert np.mean(kept) == pytest.approx(1, abs=0.0025)


@pytest.fixture(scope="module")
def whole_ball():
    structure = structure_of(ball())
    return structure, loft_surface(Sections(trace_contours(structure)), SETTINGS)


def test_a_ball_keeps_its_volume_and_its_surface(whole_ball):
    structure, surface = whole_ball
    assert_sound(surface)
    assert surface.mesh.volume == pytest.approx(structure.mask.sum(), rel=0.001)
    away = np.abs(np.linalg.norm(surface.vertices - 30, axis=1) - 20)
    assert away.mean() < 0.05
    assert away.max() < 0.5  # as far as the pixels themselves
    assert agreement(surface, structure.mask) > 0.998
    # both principal curvatures of a ball are 1 / R; what is left of the pixels adds up to .3
    assert 2 / 20 < surface.mesh.curvature_per_area < 1.3 * 2 / 20
    assert len(surface.bodies[0].vertices) < 250


def test_anisotropic_oblique_scans_come_out_in_world_mm():
    angle = np.deg2rad(25)
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1.0]])
    spacing = np.array([0.8, 0.8, 3.0])
    affine = np.eye(4)
    affine[:3, :3] = turn @ np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0.0]]) * spacing
    affine[:3, 3] = (-40, 12, 700)
    mask = ball((60, 60, 20), (30, 30, 10), 20, spacing)
    surface = loft_surface(Sections(trace_contours(structure_of(mask, affine=affine))), SETTINGS)
    assert_sound(surface)
    centre = affine[:3, :3] @ (30, 30, 10) + affine[:3, 3]
    radius = np.linalg.norm(surface.vertices - centre, axis=1)
    assert np.abs(radius - 20).mean() < 0.06  # a fourteenth of a pixel


@pytest.mark.parametrize("step", [1, 8, 20])  # pixels of 0.7 mm
def test_what_the_scan_cuts_ends_half_a_slice_beyond_it_however_thick_slices_are(step):
    disc = np.sum((grid(40, 40, 6)[:2] - 20) ** 2, axis=0) < 120
    surface = lofted(disc, (0.7, 0.7, step))
    assert_sound(surface)
    assert surface.mesh.volume == pytest.approx(disc.sum() * 0.49 * step, rel=0.001)
    heights = surface.vertices[:, 2]
    assert (heights.min(), heights.max()) == pytest.approx((-step / 2, 5.5 * step), abs=1e-6)


def test_the_rim_where_the_scan_cuts_an_organ_is_sharp_and_smooth():
    disc = np.sum((grid(60, 60, 12)[:2] - 30) ** 2, axis=0) < 20.3**2
    surface = lofted(disc)
    mesh, (body,) = surface.mesh, surface.bodies
    assert set(np.unique(body.sharpness)) == {10.0}
    assert np.isin(np.round(body.vertices[body.creases.ravel(), 2], 6), [-0.5, 11.5]).all()
    level = np.abs(mesh.unit_normals[:, 2])
    assert mesh.face_areas[(level < 0.9999) & (level > 0.1)].sum() < 1e-3 * mesh.area
    on_cap = np.isin(mesh.vertices[:, 2], (-0.5, 11.5))
    walls = mesh.faces[level < 0.1]
    rim = np.intersect1d(walls[on_cap[walls]], mesh.faces[level > 0.9999])
    radius = np.linalg.norm(mesh.vertices[rim, :2] - 30, axis=1)
    away = np.abs(radius - np.sqrt(disc[..., 0].sum() / np.pi))
    assert away.mean() < 0.1
    assert away.max() < 0.5  # as far as the disc's own pixels


def test_drawn_outlines_are_not_moved_outwards():
    angle = np.linspace(0, 2 * np.pi, 200, endpoint=False)
    circle = np.column_stack([30 + 15.3 * np.cos(angle), 30 + 15.3 * np.sin(angle)])
    surface = loft_surface(Sections(drawn(22 * [circle], shape=(60, 60, 22))), SETTINGS)
    assert_sound(surface)
    middle = np.abs(surface.vertices[:, 2] - 10) < 5
    radius = np.hypot(*(surface.vertices[middle, :2] - 30).T)
    assert radius.mean() == pytest.approx(15.3, abs=0.05)
    # Cut by the scan at both ends: planar caps half a slice beyond the first and the last slice.
    assert surface.vertices[:, 2].min() == pytest.approx(-0.5)
    assert surface.vertices[:, 2].max() == pytest.approx(21.5)
    assert surface.report["cut_ends"] == 2


def test_a_cavity_is_subtracted():
    mask = ball(radius=22) & ~ball(radius=11)
    surface = lofted(mask)
    assert_sound(surface)
    assert [body.sign for body in surface.bodies] == [1, -1]
    assert surface.bodies[1].tessellate(2).volume == pytest.approx(-ball(radius=11).sum(), rel=0.02)
    assert surface.mesh.volume == pytest.approx(mask.sum(), rel=0.001)


def test_a_shelf_that_appears_at_once_leaves_no_ripples():
    x, y, z = grid(110, 60, 40)
    mask = np.hypot(x - 28, y - 30) <= 20
    mask |= (x >= 28) & (x < 100) & (np.abs(y - 30) <= 5) & (z >= 20)
    mask &= (z >= 3) & (z < 37)
    structure = structure_of(mask)
    surface = loft_surface(Sections(trace_contours(structure)), SETTINGS)
    assert_sound(surface)
    away = np.linalg.norm(surface.vertices[:, :2] - (28, 30), axis=1) - 20
    far_wall = (np.abs(surface.vertices[:, 2] - 20) < 12) & (surface.vertices[:, 0] < 24)
    assert np.abs(away[far_wall]).max() < 0.5  # as far as the pixels themselves
    assert measure_surface(surface, structure)["hausdorff_mm"] < np.sqrt(3)  # a voxel's diagonal


def test_what_only_the_cut_slice_shows_is_kept():
    x, y, z = grid(110, 60, 10)
    mask = np.hypot(x - 28, y - 30) <= 20
    mask |= (x >= 28) & (x < 100) & (np.abs(y - 30) <= 10) & (z == 0)
    surface = lofted(mask, (1.0, 1.0, 3.0))
    assert_sound(surface)
    inside = voxelise(surface.mesh, surface.frame.affine, mask.shape)
    assert dice(mask[:, :, 0], inside[:, :, 0]) > 0.99
    assert surface.vertices[:, 2].min() == pytest.approx(-1.5)


@pytest.mark.parametrize(("missing", "bodies"), [(2, 1), (9, 2)])
def test_missing_slices_are_bridged_up_to_a_limit(missing, bodies):
    x, y, _ = grid(40, 40, 40)
    mask = np.hypot(x - 20, y - 20) <= 10
    mask[:, :, 18 : 18 + missing] = False
    surface = lofted(mask)
    assert_sound(surface)
    assert surface.report["bodies"] == bodies


def test_one_slice_is_a_lens():
    mask = ball()
    mask[:, :, :30] = mask[:, :, 31:] = False
    surface = lofted(mask)
    assert_sound(surface)
    # control points are rounded by up to .8 % of its thickness
    assert surface.mesh.volume == pytest.approx(mask.sum(), rel=0.002)


def test_a_single_triangle_is_enough():
    points = np.array([[10.2, 10.1], [18.7, 11.3], [13.4, 19.2]])
    assert_sound(loft_surface(Sections(drawn([points], [4], (30, 30, 9))), SETTINGS))


def test_what_is_lost_is_told_by_its_volume(whole_ball):
    assert whole_ball[1].report["warnings"] == []
    mask = ball((60, 60, 40), (30, 30, 20), 14)
    mask[4:6, 4:6, 5] = mask[50:52, 50:52, 30] = True
    report = lofted(mask, (0.5, 0.5, 2)).report
    assert report["bodies"] == 1
    assert report["warnings"] == [
        "dropped 2 fragments smaller than 6 voxels (4 mm³ in total); "
        "lower surface.smallest_part_voxels to keep them"
    ]
    shell = np.abs(np.linalg.norm(np.stack(grid(24, 24, 24), -1) - 11.5, axis=-1) - 7) < 0.3  # full of holes
    surface = lofted(shell)
    assert surface.mesh.volume < 0.5 * shell.sum()
    assert "of its slices' volume" in " ".join(surface.report["warnings"])


def test_curves_between_the_pixels_are_an_input_error():
    points = np.array([[10.2, 10.1], [18.6, 10.2], [18.4, 10.25]])
    sliver = drawn([points], [4], (30, 30, 9))
    assert "centre of a pixel" in refusal(loft_surface, Sections(sliver), SETTINGS)


def test_caps_end_where_the_last_slices_point():
    """To a fifth of the distance between them."""
    spacing = (2.0, 2.0, 5.0)
    mask = ball((40, 40, 24), (20, 20, 12.1), 30, spacing)
    surface = lofted(mask, spacing)
    assert surface.vertices[:, 2].min() == pytest.approx(5 * 12.1 - 30, abs=1.0)
    assert surface.vertices[:, 2].max() == pytest.approx(5 * 12.1 + 30, abs=1.0)


def test_an_open_vessel_runs_through_the_cut_end():
    x, y, z = grid(50, 50, 16)
    mask = (np.hypot(x - 25, y - 25) <= 20) & (z < 16)
    mask &= ~((np.hypot(x - 25, y - 36) <= 4) & (z > 0))
    mask &= ~((np.abs(x - 25) <= 3) & (y > 34) & (z == 0))  # in the first slice it reaches the outside
    surface = lofted(mask)
    assert surface.mesh.is_closed_manifold
    inside = voxelise(surface.mesh, surface.frame.affine, mask.shape)
    assert not inside[25, 36].any()


@settings(max_examples=10, deadline=None)
@given(
    hnp.arrays(float, st.tuples(st.integers(1, 5), st.just(4)), elements=st.floats(0, 1, width=32)),
    st.sampled_from([(1.0, 1.0, 1.0), (1.0, 1.0, 3.0), (0.7, 0.9, 1.5)]),
)
def test_unions_of_balls_are_always_sound(balls, spacing):
    mask = np.zeros((36, 36, 18), bool)
    for x, y, z, size in balls:
        mask |= ball(mask.shape, (4 + 28 * x, 4 + 28 * y, 18 * z), 2 + 6 * size)
    mask[[0, -1]] = mask[:, [0, -1]] = False
    curves = curves_of(mask, spacing)
    if len(curves):
        assert_sound(loft_surface(Sections(curves), SETTINGS))
