"""The same organ in every format gives the same voxels or contours."""

import numpy as np
import pytest
from scipy import ndimage
from support import scans


def shoelace(points):
    x, y = points.T
    return (x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """One organ on one oblique grid, in all formats."""
    path = tmp_path_factory.mktemp("formats")
    mask, affine = scans.organ(), scans.dicom_affine(turn=(8, -12, 20))
    image = (scans.grey(mask) // 2 * 2).astype(np.int16)
    scans.write_nifti(path / "image.nii.gz", image, affine)
    scans.write_nifti(path / "mask.nii.gz", mask.astype(np.uint8), affine)
    for suffix in ("nrrd", "mha"):
        scans.write_itk(path / f"image.{suffix}", image, affine)
        scans.write_itk(path / f"mask.{suffix}", mask.astype(np.uint8), affine)
    series = scans.write_series(path / "dicom", image, affine)
    slices = range(image.shape[2])
    scans.write_enhanced(path / "enhanced.dcm", image, affine, slices)
    scans.write_enhanced(
        path / "shuffled.dcm", image, affine, np.random.default_rng(0).permutation(slices).tolist()
    )
    scans.write_seg(path / "seg.dcm", {"other": ~mask, "organ": mask}, series, ["other", "organ"])
    scans.write_structure_set(
        path / "rt.dcm", {"body": scans.outlines(mask, affine)[:1], "organ": scans.outlines(mask, affine)}
    )
    np.save(path / "mask.npy", mask)
    np.save(path / "image.npy", image)
    return path


@pytest.mark.parametrize(
    ("image", "mask", "label"),
    [
        ("image.nii.gz", "mask.nii.gz", "1"),
        ("image.nrrd", "mask.nrrd", ""),
        ("image.mha", "mask.mha", "1"),
        ("dicom", "mask.nii.gz", ""),
        ("enhanced.dcm", "mask.nii.gz", ""),
        ("shuffled.dcm", "mask.nii.gz", ""),
        ("dicom", "seg.dcm", "organ"),
        ("dicom", "seg.dcm", "2"),
        ("", "mask.nrrd", ""),
    ],
)
def test_same_mask_and_image(folder, image, mask, label):
    structure = scans.load(folder, image=image, mask=mask, label=label)
    expected = np.load(folder / "mask.npy")
    assert structure.frame.slice_axis == 2
    np.testing.assert_allclose(structure.frame.affine, scans.dicom_affine(turn=(8, -12, 20)), atol=1e-4)
    np.testing.assert_array_equal(scans.full(structure), expected)
    if image:
        source = np.load(folder / "image.npy")
        first = structure.origin
        clipped = [
            np.clip(np.arange(o, o + n), 0, m - 1)
            for o, n, m in zip(first, structure.image.shape, source.shape, strict=True)
        ]
        np.testing.assert_array_equal(structure.image, source[np.ix_(*clipped)])


def test_rtstruct_contours_are_the_organ(folder):
    structure = scans.load(folder, image="dicom", mask="rt.dcm", label="organ")
    mask = np.load(folder / "mask.npy")
    curves = structure.contours
    assert structure.mask is None
    assert structure.image is not None
    np.testing.assert_array_equal(scans.inside(curves, mask.shape), mask)
    assert np.all(np.diff(curves.slice) >= 0)
    assert curves.hole.any()
    assert all((shoelace(points) < 0) == hole for points, hole in zip(curves, curves.hole, strict=True))
    assert all((points[0] != points[-1]).any() for points in curves)


def test_jpeg_2000_and_lying_thickness(tmp_path):
    mask, affine = scans.organ(), scans.dicom_affine()
    image = (scans.grey(mask) // 2 * 2).astype(np.int16)
    scans.write_series(tmp_path / "dicom", image, affine, thickness=5.0, compress=True)
    scans.write_nifti(tmp_path / "mask.nii", mask.astype(np.uint8), affine)
    structure = scans.load(tmp_path, image="dicom", mask="mask.nii")
    assert structure.frame.slice_spacing == pytest.approx(4.0)
    np.testing.assert_array_equal(scans.full(structure), mask)


def test_a_flipped_mask_of_a_part_is_brought_to_the_image(tmp_path):
    """What dcm2niix does: rows turned over, and here the axes permuted and empty voxels cut off as well."""
    mask, affine = scans.organ(), scans.dicom_affine()
    image = (scans.grey(mask) // 2 * 2).astype(np.int16)
    scans.write_series(tmp_path / "dicom", image, affine)
    turned = np.flip(mask[2:, :, 1:], 1).transpose(2, 0, 1)
    moved = affine.copy()
    moved[:3, 3] += affine[:3, :3] @ (2, mask.shape[1] - 1, 1)
    moved[:3, 1] *= -1
    scans.write_nifti(tmp_path / "mask.nii", turned.astype(np.uint8), moved[:, [2, 0, 1, 3]])
    structure = scans.load(tmp_path, image="dicom", mask="mask.nii")
    np.testing.assert_array_equal(scans.full(structure), mask)


def test_resampling_only_when_asked(tmp_path):
    mask = scans.organ()
    scans.write_nifti(tmp_path / "mask.nii", mask.astype(np.uint8), scans.affine_of())
    a, b, c = np.indices((50, 50, 40), float)
    coarse = scans.affine_of(spacing=(2.0, 2.0, 2.0), origin=(-35.0, 8.0, 3.0))
    ramp = (a * 2 - 35) + 2 * (b * 2 + 8) - 3 * (c * 2 + 3)
    scans.write_nifti(tmp_path / "image.nii", ramp.astype(np.float32), coarse)
    structure = scans.load(tmp_path, changes={"resample": True}, image="image.nii", mask="mask.nii")
    np.testing.assert_array_equal(scans.full(structure), mask)
    index = np.argwhere(structure.mask)
    world = (index + structure.origin) @ structure.frame.affine[:3, :3].T + structure.frame.affine[:3, 3]
    np.testing.assert_allclose(structure.image[structure.mask], world @ (1, 2, -3), atol=1e-2)
    assert any("interpolated" in note for note in structure.warnings)


def test_gaps_are_filled_only_when_asked(tmp_path):
    mask, affine = scans.organ(), scans.dicom_affine()
    ramp = np.broadcast_to(np.arange(14) * 20, mask.shape).astype(np.int16)
    scans.write_series(tmp_path / "dicom", ramp, affine, skip=(5, 6))
    scans.write_nifti(tmp_path / "mask.nii", mask.astype(np.uint8), affine)
    structure = scans.load(tmp_path, changes={"fill_gaps": True}, image="dicom", mask="mask.nii")
    assert any("2 slices are missing" in note for note in structure.warnings)
    inner = structure.image[:, :, -structure.origin[2] :][:, :, :14]
    np.testing.assert_allclose(inner[20, 20], np.arange(14) * 20, atol=1e-3)


def test_several_rois_are_united(tmp_path):
    mask, affine = scans.organ(), scans.dicom_affine()
    scans.write_series(tmp_path / "dicom", scans.grey(mask), affine)
    left, right = mask.copy(), mask.copy()
    left[20:], right[:20] = False, False
    rois = {"left": scans.outlines(left, affine), "right": scans.outlines(right, affine)}
    scans.write_structure_set(tmp_path / "rt.dcm", rois)
    structure = scans.load(tmp_path, image="dicom", mask="rt.dcm", label="left,right")
    np.testing.assert_array_equal(scans.inside(structure.contours, mask.shape), mask)


def test_a_contour_that_goes_out_and_back_encloses_nothing_and_is_left_out(tmp_path):
    square = np.array([(0, 0), (20, 0), (20, 20), (0, 20)], float)
    there_and_back = np.array([(0, 0), (10, 0), (10, 10), (10, 0)], float)
    shapes = [(square, z) for z in (0.0, 3.0, 6.0, 9.0)] + [(there_and_back, 12.0)]
    contours = [np.column_stack([shape, np.full(4, z)]) for shape, z in shapes]
    scans.write_structure_set(tmp_path / "rt.dcm", {"square": contours})
    structure = scans.load(tmp_path, mask="rt.dcm")
    assert [abs(shoelace(points)) for points in structure.contours] == pytest.approx([400] * 4)
    assert any("1 contours without area left out" in note for note in structure.warnings)


def test_contours_on_every_third_slice(tmp_path):
    mask, affine = scans.organ(), scans.dicom_affine()
    scans.write_series(tmp_path / "dicom", scans.grey(mask), affine)
    sparse = np.zeros_like(mask)
    sparse[:, :, 2::3] = mask[:, :, 2::3]
    scans.write_structure_set(tmp_path / "rt.dcm", {"organ": scans.outlines(sparse, affine)})
    structure = scans.load(tmp_path, image="dicom", mask="rt.dcm")
    assert structure.frame.slice_spacing == pytest.approx(12.0)
    assert structure.frame.shape[2] == 4
    np.testing.assert_array_equal(scans.inside(structure.contours, (44, 38, 4)), mask[:, :, 2::3])
    assert any("3" in note for note in structure.warnings)


def test_label_maps(tmp_path):
    mask, affine = scans.organ(), scans.affine_of()
    labels = np.where(mask, 5, 0).astype(np.uint8)
    labels[:22][mask[:22]] = 7
    labels[0, 0, 0] = 9
    scans.write_nifti(tmp_path / "labels.nii", labels, affine)

    def load(label):
        return scans.load(tmp_path, mask="labels.nii", label=label)

    np.testing.assert_array_equal(scans.full(load("5")), labels == 5)
    np.testing.assert_array_equal(scans.full(load("5,7")), mask)
    everything = load("")
    np.testing.assert_array_equal(scans.full(everything), labels > 0)
    assert any("no label given" in note for note in everything.warnings)


@pytest.mark.parametrize(
    "stored",
    [
        lambda mask: mask.astype(np.float64),
        lambda mask: mask * np.float32(0.9) + np.float32(0.05),
        lambda mask: (mask * 255).astype(np.uint8),
        lambda mask: mask.astype(np.float32) * (1 + 1e-5),
    ],
    ids=["float", "probability", "255", "rounding"],
)
def test_masks_of_any_kind(tmp_path, stored):
    mask = scans.organ()
    scans.write_nifti(tmp_path / "mask.nii", stored(mask), scans.affine_of())
    np.testing.assert_array_equal(scans.full(scans.load(tmp_path, mask="mask.nii")), mask)


def test_mask_on_the_faces_of_the_array(tmp_path):
    mask = np.ones((6, 7, 5), np.uint8)
    scans.write_nifti(tmp_path / "mask.nii", mask, scans.affine_of())
    scans.write_nifti(tmp_path / "image.nii", scans.grey(mask.astype(bool)), scans.affine_of())
    structure = scans.load(tmp_path, image="image.nii", mask="mask.nii")
    assert structure.origin.tolist() == [-3, -3, -3]
    assert structure.mask.shape == (12, 13, 11)
    assert structure.mask.sum() == mask.size
    assert not structure.mask[[0, 1, 2, -1, -2, -3]].any()
    assert any("cut" in note for note in structure.warnings)


def test_boundary_stack_with_mask_beside_it(tmp_path):
    mask = scans.organ()
    eroded = ndimage.binary_erosion(mask, np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]])[:, :, None])
    boundary = mask & ~eroded
    scans.write_nifti(tmp_path / "mask.nii", mask.astype(np.uint8), scans.affine_of())
    scans.write_nifti(tmp_path / "edges.nii", boundary.astype(np.uint8), scans.affine_of())
    structure = scans.load(tmp_path, boundary="edges.nii", mask="mask.nii")
    np.testing.assert_array_equal(scans.full(structure, "boundary"), boundary)
    np.testing.assert_array_equal(scans.full(structure), mask)
    alone = scans.load(tmp_path, boundary="edges.nii")
    assert alone.mask is None


def test_provenance_names_files_and_checksums(tmp_path):
    import hashlib

    path = scans.write_nifti(tmp_path / "mask.nii", scans.organ().astype(np.uint8), scans.affine_of())
    facts = scans.load(tmp_path, mask="mask.nii").provenance
    assert facts["files"] == {"mask.nii": hashlib.sha256(path.read_bytes()).hexdigest()}
    assert "nibabel" in facts["versions"]
