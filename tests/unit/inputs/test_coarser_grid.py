"""Masks whose voxels are copies of coarser ones: those are found, and the surface is made of them."""

import nibabel as nib
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy import ndimage
from support.scans import DATA, load, write_nifti

import cccd
from cccd.inputs.coarser_grid import find_coarser_grid
from cccd.inputs.load import structure_of_array
from cccd.settings.imports import ImportSettings
from cccd.settings.surface import LoftSettings
from cccd_datasets.implicit_solids import sample_lattice
from cccd_datasets.phantoms import ORGANS
from cccd_labels.shared_walls import share_walls
from cccd_workflow.surface_measures import mask_surface, voxel_volume

RADIUS, VOXEL = 24.0, 3.0


def ball(voxel, radius=RADIUS, shift=(0.0, 0.0, 0.0)):
    """Mask of a ball at (0, 0, 0) and its affine."""
    half = np.ceil(radius / voxel) + 3
    affine = np.diag([voxel, voxel, voxel, 1.0])
    affine[:3, 3] = np.array(shift) - half * voxel
    index = np.indices((2 * int(half) + 1,) * 3)
    places = np.moveaxis(index, 0, -1) * voxel + affine[:3, 3]
    return np.linalg.norm(places, axis=-1) < radius, affine


def resized(mask, shape):
    """Copy a mask to another grid with the centres of the corner voxels in place, as SciPy's zoom does."""
    ratios = np.array(shape) / mask.shape
    return ndimage.zoom(mask.astype(np.uint8), ratios, order=0) > 0


def copied_ball():
    """Copy a ball of 3 mm voxels to 1 x .8 x 1.5 mm."""
    mask, affine = ball(VOXEL)
    fine = resized(mask, np.rint(np.array(mask.shape) * (3.0, 3.75, 2.0)).astype(int))
    scale = (np.array(mask.shape) - 1) / (np.array(fine.shape) - 1)
    return mask, affine, fine, affine @ np.diag([*scale, 1.0])


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 1000), ratios=st.tuples(*[st.floats(1.5, 5)] * 3), faces=st.booleans())
@example(seed=0, ratios=(2.0, 2.0, 3.90625), faces=False)  # 4 fits all borders, and a voxel more is needed
def test_the_voxels_that_were_copied_are_found(seed, ratios, faces):
    rng = np.random.default_rng(seed)
    noise = ndimage.gaussian_filter(rng.normal(size=(48, 52, 44)), 3)
    mask = np.pad((noise > 0)[1:-1, 1:-1, 1:-1], 1)  # SciPy's zoom loses some of the last voxels
    shape = np.rint(np.array(mask.shape) * ratios).astype(int)
    if faces:
        index = [((np.arange(n) + 0.5) * m / n).astype(int) for n, m in zip(shape, mask.shape, strict=True)]
        fine = mask[np.ix_(*index)]
    else:
        fine = resized(mask, shape)
    found = find_coarser_grid(fine, np.ones(3))
    assert found is not None
    assert np.prod(found.of(fine).shape) <= 1.1 * mask.size
    # copied to the nearest voxels again, it is the file; where two are as near, either may be
    coarse = found.of(fine)
    starts, ratios = found.affine[:3, 3], found.affine.diagonal()[:3]
    place = [(np.arange(n) - start) / ratio for n, start, ratio in zip(shape, starts, ratios, strict=True)]
    nearest = [np.rint(x).astype(int).clip(0, m - 1) for x, m in zip(place, coarse.shape, strict=True)]
    clear = np.ix_(*[np.abs(x % 1 - 0.5) > 1e-3 for x in place])
    np.testing.assert_array_equal(coarse[np.ix_(*nearest)][clear], fine[clear])


@pytest.mark.parametrize("organ", sorted(ORGANS))
def test_an_organ_on_its_own_voxels_is_left_alone(organ):
    spacing = (1.5, 1.5, 2.25)
    anatomy = ORGANS[organ](np.random.default_rng(1))
    low, size = anatomy.bbox_min - 3 * np.array(spacing), anatomy.bbox_max - anatomy.bbox_min
    shape = np.ceil(size / spacing).astype(int) + 7
    mask = sample_lattice(anatomy.organ, low, np.array(spacing), shape) < 0
    assert find_coarser_grid(mask, np.array(spacing)) is None


def test_real_masks_on_their_own_voxels_are_left_alone():
    files = [*sorted(DATA.glob("hippocampus_msd/labels/*.nii.gz")), *DATA.glob("liver_totalseg_ct3mm/*mask*")]
    if not files:
        pytest.skip("the shared scans are not here")
    for file in files:
        image = nib.load(file)
        assert find_coarser_grid(np.asarray(image.dataobj), np.ones(3)) is None, file.name


def test_the_surface_of_a_copied_mask_is_that_of_the_coarse_one():
    mask, coarse, fine, affine = copied_ball()
    given_coarse = cccd.reconstruct(structure_of_array(mask, coarse, ImportSettings(), "ball"))
    structure = structure_of_array(fine, affine, ImportSettings(), "ball")
    assert structure.frame.copied_to.shape == fine.shape
    np.testing.assert_allclose(structure.frame.spacing, VOXEL)
    given_fine = cccd.reconstruct(structure)
    np.testing.assert_allclose(given_fine.vertices, given_coarse.vertices, atol=1e-6)


def test_an_organ_cut_by_the_scan_ends_at_the_files_last_voxels():
    disc = ball(VOXEL)[0][:, :, 8:-8]
    fine = resized(disc, (np.array(disc.shape) * (3, 3, 2)).astype(int))
    scale = (np.array(disc.shape) - 1) / (np.array(fine.shape) - 1)
    affine = np.diag([*(VOXEL * scale), 1.0])
    structure = structure_of_array(fine, affine, ImportSettings(), "disc")
    surface = cccd.reconstruct(structure)
    ends = affine[2, 2] * np.array((-0.5, fine.shape[2] - 0.5))
    np.testing.assert_allclose((surface.vertices[:, 2].min(), surface.vertices[:, 2].max()), ends, atol=0.01)
    # of six blocks some have two and some three of the file's twelve slices
    assert voxel_volume(structure) == pytest.approx(fine.sum() * np.linalg.det(affine), rel=0.03)
    assert surface.lofted.mesh.volume == pytest.approx(voxel_volume(structure), rel=0.005)
    cubes = mask_surface(structure).vertices[:, 2]
    np.testing.assert_allclose((cubes.min(), cubes.max()), ends)


def test_all_labels_of_a_file_get_the_grid_that_the_file_was_copied_from(tmp_path):
    mask, _ = ball(VOXEL)
    labels = mask.astype(np.uint8)
    labels[9:12, 9:12, 9:12][mask[9:12, 9:12, 9:12]] = 2  # too small to tell by itself
    fine = ndimage.zoom(labels, 3, order=0)
    write_nifti(tmp_path / "labels.nii.gz", fine, np.eye(4))
    assert find_coarser_grid(fine == 2, np.ones(3)) is None
    one, two = (load(tmp_path, mask="labels.nii.gz", label=label) for label in ("1", "2"))
    assert one.frame.shape == two.frame.shape == mask.shape
    np.testing.assert_array_equal(one.frame.affine, two.frame.affine)


def test_grey_values_are_averaged_over_the_voxels_that_were_copied(tmp_path):
    mask, _ = ball(VOXEL)
    places = np.moveaxis(np.indices(np.array(mask.shape) * 3), 0, -1)
    grey = (places @ (1.0, 2.0, -0.5)).astype(np.float32)
    fine = np.kron(mask, np.ones((3, 3, 3))).astype(np.uint8)
    write_nifti(tmp_path / "mask.nii.gz", np.flip(fine, 1), np.eye(4))
    write_nifti(tmp_path / "image.nii.gz", grey, np.diag([1.0, -1.0, 1.0, 1.0]) @ shifted(fine.shape[1] - 1))
    structure = load(tmp_path, mask="mask.nii.gz", image="image.nii.gz")
    assert structure.frame.copied_to.shape == grey.shape
    centres = 3 * (np.moveaxis(np.indices(structure.image.shape), 0, -1) + structure.origin) + 1
    inside = structure.mask
    np.testing.assert_allclose(structure.image[inside], (centres @ (1.0, 2.0, -0.5))[inside], rtol=1e-5)


def shifted(last):
    """Affine of an axis that starts at its last voxel."""
    affine = np.eye(4)
    affine[1, 3] = -last
    return affine


def test_drawn_slices_are_no_copies():
    mask, affine = ball(1.0)
    mask[:, :, np.arange(mask.shape[2]) % 4 > 0] = False
    structure = structure_of_array(mask, affine, ImportSettings(), "ball")
    assert structure.annotation is not None
    assert structure.frame.copied_to is None


def test_files_lie_on_the_grid_of_the_file(tmp_path, answer):
    _, _, fine, affine = copied_ball()
    nib.save(nib.Nifti1Image(fine.astype(np.uint8), affine), tmp_path / "ball.nii.gz")
    written = tmp_path / "out.nii.gz"
    report = answer("surface", tmp_path / "ball.nii.gz", "-o", written)
    assert any("3 x 3 x 3 mm" in line for line in report["surfaces"][0]["warnings"])
    image = nib.load(written)
    assert image.shape == fine.shape
    np.testing.assert_allclose(image.affine, affine, atol=1e-5)
    inside = np.asarray(image.dataobj) > 0
    assert 2 * (inside & fine).sum() / (inside.sum() + fine.sum()) > 0.95


def test_organs_in_files_of_their_own_share_walls(tmp_path):
    mask, affine = ball(VOXEL)
    low, high = mask.copy(), mask.copy()
    low[:, :, 10:], high[:, :, :10] = False, False
    spot = np.zeros_like(mask)
    spot[9:12, 9:12, 9:12] = True  # too small to tell by itself: it stays on the file's voxels
    parts = {"low": low & ~spot, "high": high & ~spot, "spot": spot}
    structures = {
        number: structure_of_array(
            ndimage.zoom(part.astype(np.uint8), 3, order=0) > 0, affine, ImportSettings(), name
        )
        for number, (name, part) in enumerate(parts.items(), 1)
    }
    assert structures[3].frame.shape != structures[1].frame.shape == structures[2].frame.shape
    walls = share_walls(structures, LoftSettings())
    for number, structure in structures.items():
        mesh = walls.surface.mesh_of(number)
        assert mesh.is_closed_manifold
        voxels = structure.mask.sum() * abs(np.linalg.det(structure.frame.affine))
        assert mesh.volume == pytest.approx(voxels, rel=0.25 if number == 3 else 0.03)
    assert set(map(tuple, np.sort(walls.surface.regions, axis=1))) >= {(1, 2), (1, 3), (2, 3)}


def test_two_boxes_that_touch_at_an_edge_are_no_copies_of_two_voxels():
    mask = np.zeros((32, 32, 32), bool)
    mask[6:16, 6:16, 6:26] = mask[16:26, 16:26, 6:26] = True
    structure = structure_of_array(mask, np.diag((0.8, 0.8, 4.0, 1.0)), ImportSettings(), "boxes")
    assert structure.frame.copied_to is None
