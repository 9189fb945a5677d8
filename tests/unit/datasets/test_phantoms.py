import functools
import itertools

import numpy as np
import pytest
from scipy import ndimage
from support.refusals import refusal
from support.scans import load, load_structure, row, settings

from cccd.geometry.raster import voxelise
from cccd.store import read_ply
from cccd_datasets import PHANTOM_ORGANS
from cccd_datasets.implicit_solids import (
    capsule,
    ellipsoid,
    half_space,
    intersection,
    mesh_zero_set,
    sample_lattice,
    subtraction,
    torus,
    union,
)
from cccd_datasets.phantoms import ORGANS, make_phantom
from cccd_paper.phantom_files import describe_scan, write_scan, write_truth

COARSE = (2.0, 2.0, 6.0)


@functools.cache
def cached(organ):
    return phantom(organ)


def phantom(organ, case="a", seed=1, spacing_mm=COARSE):
    return load_structure(
        row(source="phantom", case=case, organ=organ), ".", settings(phantom={"spacing_mm": spacing_mm}), seed
    )


@pytest.mark.parametrize("organ", ORGANS)
def test_mask_image_and_truth_agree(organ):
    structure = cached(organ)
    mesh = structure.truth.to_trimesh()
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    voxels = structure.mask.sum() * abs(np.linalg.det(structure.frame.affine[:3, :3]))
    assert mesh.body_count == {"lungs": 2, "two_spheres": 2, "shell": 2}.get(organ, 1)
    assert structure.truth.genus == (organ in ("torus", "A"))
    # strokes of letters are 16 mm thick, less than three slices, and most bronchi less than one
    assert voxels == pytest.approx(mesh.volume, rel=0.04 if organ in ("A", "H", "X", "bronchi") else 0.02)
    # the mask is the voxels whose centres are inside
    filled = voxelise(structure.truth, structure.frame.affine, structure.mask.shape, structure.origin)
    assert np.count_nonzero(filled ^ structure.mask) <= 0.005 * filled.sum()
    # a margin on all sides
    assert not structure.mask[[0, -1]].any()
    assert not structure.mask[:, :, [0, -1]].any()
    assert np.isfinite(structure.image).all()


def test_grey_values_are_hounsfield():
    liver, lungs = cached("liver"), cached("lungs")
    assert np.median(liver.image[liver.mask]) == pytest.approx(105, abs=2)
    assert np.median(lungs.image[lungs.mask]) == pytest.approx(-850, abs=5)
    assert liver.image.min() >= -1100
    assert liver.image.max() <= 600


def test_shapes_stand_for_what_they_are():
    """Lungs are two bodies that split and merge along z; the torus goes from one contour to two; shell."""

    def counts(structure):
        return [ndimage.label(part, np.ones((3, 3)))[1] for part in structure.stack("mask") if part.any()]

    lungs = counts(cached("lungs"))
    assert max(lungs) >= 3
    assert (np.diff(lungs) > 0).any()
    assert (np.diff(lungs) < 0).any()
    ring = counts(phantom("torus", spacing_mm=[1.0, 1.0, 3.0]))
    assert ring[0] == 1
    assert 2 in ring
    assert ring[-1] == 1


@pytest.mark.parametrize(("letter", "contours"), {"A": [2, 1, 2, 1], "H": [2, 1, 2], "X": [2, 1, 2]}.items())
def test_letters_stand_on_slices_on_which_they_branch_and_merge(letter, contours):
    """Upwards, the two legs of an A meet in its bar, part around its hole, and meet in its apex."""
    counts = [
        ndimage.label(part)[1]
        for part in phantom(letter, spacing_mm=[1.0, 1.0, 3.0]).stack("mask")
        if part.any()
    ]
    assert [count for count, _ in itertools.groupby(counts)] == contours


def test_seed_and_case_decide():
    first, again = phantom("kidney"), phantom("kidney")
    np.testing.assert_array_equal(first.image, again.image)
    np.testing.assert_array_equal(first.truth.vertices, again.truth.vertices)
    for other in (phantom("kidney", case="b"), phantom("kidney", seed=2)):
        assert not np.array_equal(other.truth.vertices, first.truth.vertices)


def test_noise_and_spacing_are_as_asked():
    quiet, loud = (
        make_phantom("a", "sphere", COARSE, seed=1, margin_voxels=3, location="x", blur_mm=0, noise_hu=noise)
        for noise in (0, 40)
    )
    assert (loud.image - quiet.image).std() == pytest.approx(40, rel=1e-3)
    np.testing.assert_allclose(quiet.frame.spacing, (2, 2, 6))
    # partial volume: between fat and organ there are values in between
    edge = (quiet.image > -60) & (quiet.image < 30)
    assert 0.01 < edge.mean() < 0.2


def test_unknown_organ():
    assert "did you mean 'liver'" in refusal(phantom, "livr")


POINTS = np.random.default_rng(3).uniform(-30, 30, (3, 2000))


def test_exact_distances():
    x, y, z = POINTS
    np.testing.assert_allclose(
        ellipsoid((1, 2, 3), (9, 9, 9))(POINTS), np.sqrt((x - 1) ** 2 + (y - 2) ** 2 + (z - 3) ** 2) - 9
    )
    bar = capsule((-10, 0, 0), (10, 0, 0), 3)(POINTS)
    np.testing.assert_allclose(bar, np.sqrt((x - np.clip(x, -10, 10)) ** 2 + y**2 + z**2) - 3)
    ring = torus((0, 0, 0), 12, 4, axis=2)(POINTS)
    np.testing.assert_allclose(ring, np.hypot(np.hypot(x, y) - 12, z) - 4)
    np.testing.assert_allclose(half_space((0, 0, 4), (0, 0, 2))(POINTS), z - 4)


def test_boolean_operations_agree_with_logic():
    a, b = ellipsoid((-6, 0, 0), (14, 10, 12)), ellipsoid((6, 2, 0), (9, 15, 8))
    inside_a, inside_b = a(POINTS) < 0, b(POINTS) < 0
    np.testing.assert_array_equal(union(a, b)(POINTS) < 0, inside_a | inside_b)
    np.testing.assert_array_equal(intersection(a, b)(POINTS) < 0, inside_a & inside_b)
    np.testing.assert_array_equal(subtraction(a, b)(POINTS) < 0, inside_a & ~inside_b)
    # rounding a union only ever adds
    assert (union(a, b, radius=6)(POINTS) <= union(a, b)(POINTS)).all()


def test_sampling_is_exact_at_the_surface():
    field = union(ellipsoid((0, 0, 0), (12, 9, 15)), ellipsoid((15, 0, 0), (8, 8, 8)), radius=5)
    origin, step, shape = np.full(3, -25.0), np.array((0.7, 0.7, 1.1)), (70, 70, 50)
    values = sample_lattice(field, origin, step, shape)
    exact = field(origin.reshape(3, 1, 1, 1) + step.reshape(3, 1, 1, 1) * np.indices(shape))
    clear = np.abs(exact) > 1e-4
    np.testing.assert_array_equal((values < 0)[clear], (exact < 0)[clear])
    near = np.abs(exact) < 0.5
    np.testing.assert_allclose(values[near], exact[near], atol=1e-4)


def test_mesh_lies_on_the_zero_set():
    field = ellipsoid((1, -2, 3), (15, 15, 15))
    ball = mesh_zero_set(field, np.full(3, -20.0), np.full(3, 22.0), 2.0)
    assert np.abs(field(ball.vertices.T)).max() < 1e-4
    mesh = ball.to_trimesh()
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(4 / 3 * np.pi * 15**3, rel=0.01)


def test_bronchi_are_one_tree_that_grows_thinner_and_branches_downwards():
    slices = [part for part in cached("bronchi").stack("mask") if part.any()]
    counts = [ndimage.label(part)[1] for part in slices]
    assert counts[-4] == 1  # the trachea, below its upper end
    assert 4 * slices[-4].sum() == pytest.approx(np.pi * 8**2, rel=0.2)
    assert max(counts) > 8


def test_without_contrast_agent_a_liver_is_as_grey_as_the_muscle_it_touches():
    with_it, without = (
        make_phantom(
            "a", "liver", COARSE, seed=1, margin_voxels=8, location="x", noise_hu=0, contrast=contrast
        )
        for contrast in (True, False)
    )
    np.testing.assert_array_equal(with_it.mask, without.mask)
    share = []
    for phantom in (with_it, without):
        mask, image = phantom.mask, phantom.image
        rim = ndimage.binary_dilation(mask, iterations=3) & ~ndimage.binary_dilation(mask, iterations=2)
        share.append(np.mean(np.abs(image[rim] - np.median(image[mask])) < 5))
    assert 0.05 < share[1] < 0.6  # part of the border, and not most of it
    assert share[0] < share[1] / 3


def test_a_scan_of_a_phantom_is_found_by_its_seed_alone():
    asked = settings(phantom={"spacing_mm": (1.0, 1.0, 4.0)})
    whole = row(source="phantom_scan", organ="sphere", seed="33,33,17")
    made = load_structure(whole, ".", asked, seed=1)
    assert made.truth is not None
    assert 2 * (made.region & made.mask).sum() / (made.region.sum() + made.mask.sum()) > 0.9


def scan_torus(distance):
    return make_phantom("phantom", "torus", (1.5, 1.5, distance), seed=1, margin_voxels=3, location="")


def write(folder, distance):
    structure = scan_torus(distance)
    folder.mkdir()
    write_scan(folder / "image.nii.gz", folder / "mask.nii.gz", structure)
    write_truth(folder / "truth.ply", structure)
    return structure


def test_every_phantom_is_written():
    assert set(PHANTOM_ORGANS) == set(ORGANS)


def test_files_hold_the_scan_where_it_lies_and_are_the_same_every_time(tmp_path):
    scanned = write(tmp_path / "first", 4)
    write(tmp_path / "again", 4)
    for file in sorted((tmp_path / "first").iterdir()):
        assert file.read_bytes() == (tmp_path / "again" / file.name).read_bytes(), file.name
    read = load(tmp_path / "first", image="image.nii.gz", mask="mask.nii.gz")
    index = np.argwhere(scanned.mask) + scanned.origin
    there = np.argwhere(read.mask) + read.origin
    world = index @ scanned.frame.affine[:3, :3].T + scanned.frame.affine[:3, 3]
    again = there @ read.frame.affine[:3, :3].T + read.frame.affine[:3, 3]
    np.testing.assert_allclose(again, world, atol=1e-3)
    assert read.image[read.mask].tolist() == scanned.image[scanned.mask].tolist()
    truth = read_ply(tmp_path / "first" / "truth.ply")
    np.testing.assert_array_equal(truth.vertices, scanned.truth.vertices)
    assert (truth.vertices.min(axis=0) > world.min(axis=0) - 5).all()
    assert (truth.vertices.max(axis=0) < world.max(axis=0) + 5).all()


def test_the_truth_is_the_same_at_every_slice_distance_and_the_table_says_what_it_is():
    thin, thick = (describe_scan(scan_torus(distance)).iloc[0] for distance in (2, 8))
    same = ("organ", "volume_ml", "area_cm2", "bodies", "genus", "triangles", "pixel_i_mm")
    assert [thin[key] for key in same] == [thick[key] for key in same]
    assert thick["slice_distance_mm"] == 8
    assert thin["genus"] == thin["bodies"] == 1
    for scan in (thin, thick):
        assert scan["voxels_ml"] == pytest.approx(
            scan["voxels"] * 1.5 * 1.5 * scan["slice_distance_mm"] / 1000
        )
        assert scan["voxels_ml"] == pytest.approx(scan["volume_ml"], rel=0.02)
        height = scan["slices"] * scan["slice_distance_mm"]
        assert height == pytest.approx(2 * (28.5 + 12), abs=scan["slice_distance_mm"])
