"""Slices lie where their headers say: of a tilted gantry aside of each other, uneven ones at any height."""

import nibabel
import numpy as np
import pydicom
import pytest
from support import scans
from support.refusals import refusal

import cccd
from cccd.cli import main
from cccd.errors import InputError
from cccd.geometry.raster import dice
from cccd.inputs.grid import check_affine, find_slice_axis
from cccd.inputs.readers import read_itk
from cccd_dicom.slices import even_grid
from cccd_labels.scene import SceneOrgan, write_segmentation

RADII = np.array([16.0, 13.0, 18.0])
TRUE_ML = 4 / 3 * np.pi * RADII.prod() / 1000


def tilted(degrees, apart, shape=(64, 60), pixel=0.8):
    """Affine and shape of a scan of planes that are tilted about the left-right axis, on a straight table."""
    angle, count = np.radians(degrees), int(44 / apart)
    affine = np.eye(4)
    affine[:3, 0] = (-pixel, 0, 0)
    affine[:3, 1] = -pixel * np.array((0, np.cos(angle), np.sin(angle)))
    affine[:3, 2] = (0, 0, apart / np.cos(angle))
    size = (*shape, count)
    affine[:3, 3] = (0.2, 0.3, 0.1) - affine[:3, :3] @ ((np.array(size) - 1) / 2)
    return affine, size


def phantom(affine, size, heights=None):
    """Voxels of the ellipsoid around the world's origin."""
    index = np.moveaxis(np.indices(size), 0, -1).astype(float)
    if heights is not None:
        index[..., 2] = heights
    world = index @ affine[:3, :3].T + affine[:3, 3]
    return ((world / RADII) ** 2).sum(axis=-1) <= 1


def off(vertices):
    """Distance of points to the ellipsoid's surface, to first order."""
    level = (vertices / RADII) ** 2
    return np.abs(level.sum(axis=1) - 1) / (2 * np.linalg.norm(vertices / RADII**2, axis=1))


@pytest.mark.parametrize("apart", [1.0, 4.0])
def test_a_tilted_scan_gives_the_surface_of_a_straight_one(apart):
    errors = {}
    for degrees in (0, 22):
        affine, size = tilted(degrees, apart)
        surface = cccd.reconstruct(phantom(affine, size), affine)
        voxels = phantom(affine, size).sum() * abs(np.linalg.det(affine)) / 1000
        assert surface.volume / 1000 == pytest.approx(voxels, rel=0.005)
        assert surface.volume / 1000 == pytest.approx(TRUE_ML, rel=0.01)
        assert surface.mesh.is_watertight
        errors[degrees] = off(surface.vertices).mean()
    assert errors[22] < max(0.1, 1.4 * errors[0])


def test_a_tilted_volume_reads_and_comes_back(here, answer):
    affine, size = tilted(20, 2.5)
    mask = phantom(affine, size)
    scans.write_nifti(here / "tilted.nii.gz", mask.astype(np.uint8), affine)
    scans.write_itk(here / "tilted.nrrd", mask.astype(np.uint8), affine)
    for name in ("tilted.nii.gz", "tilted.nrrd"):
        structure = cccd.read(name)
        assert structure.frame.slice_axis == 2
        assert structure.frame.tilt == pytest.approx(20, abs=0.01)
        assert structure.frame.slice_spacing == pytest.approx(2.5)
        np.testing.assert_allclose(structure.frame.affine, affine, atol=1e-5)
    assert main(["surface", "tilted.nii.gz", "-o", "map.nii.gz", "-o", "surface.ply"]) == 0
    again = nibabel.load("map.nii.gz")
    np.testing.assert_allclose(again.affine, affine, atol=1e-5)
    assert int(again.header["qform_code"]) == 0
    assert dice(mask, np.asarray(again.dataobj) > 0) > 0.985
    (said,) = answer("check", "tilted.nii.gz")
    assert "2.5 mm apart, tilted by 20.0 degrees" in said["slices"]
    assert said["warnings"] == []
    assert main(["compare", "surface.ply", "tilted.nii.gz", "--min-dice", "0.985"]) == 0


def test_label_maps_with_shared_walls_may_be_tilted(here):
    affine, size = tilted(20, 2.5)
    labels = phantom(affine, size).astype(np.uint8)
    labels[32:][labels[32:] > 0] = 2
    scans.write_nifti(here / "map.nii.gz", labels, affine)
    surfaces, failures = cccd.reconstruct_labels("map.nii.gz")
    assert failures == []
    for label, surface in enumerate(surfaces, 1):
        voxels = (labels == label).sum() * abs(np.linalg.det(affine))
        assert surface.volume == pytest.approx(voxels, rel=0.01)
    frame = cccd.read("map.nii.gz", 1).frame
    organs = [SceneOrgan(s.name, s.name, n, "#ff0000", "", s.lofted.mesh) for n, s in enumerate(surfaces, 1)]
    write_segmentation(here / "map.seg.nrrd", organs, frame)
    np.testing.assert_allclose(read_itk(here / "map.seg.nrrd").affine, affine, atol=1e-5)


def scan(folder, affine, mask, **changes):
    """A series with a SEG and an RTSTRUCT of the mask."""
    series = scans.write_series(folder / "ct", scans.grey(mask), affine, **changes)
    scans.write_seg(folder / "mask.dcm", {"organ": mask}, series, ["organ"])


def planes_of(series_folder):
    headers = [pydicom.dcmread(path) for path in series_folder.iterdir()]
    along, down = np.reshape([float(x) for x in headers[0].ImageOrientationPatient], (2, 3))
    normal = np.cross(along, down)
    return normal, np.array([[float(x) for x in ds.ImagePositionPatient] for ds in headers]) @ normal


def test_dicom_with_gantry_tilt_goes_there_and_back(here):
    affine, size = tilted(18, 3.0)
    mask = phantom(affine, size)
    scan(here, affine, mask)
    structure = cccd.read("mask.dcm", image="ct")
    np.testing.assert_array_equal(scans.full(structure), mask)
    assert structure.frame.tilt == pytest.approx(18, abs=0.01)
    surface = cccd.reconstruct(structure)
    assert surface.volume / 1000 == pytest.approx(TRUE_ML, rel=0.01)
    surface.write("back.seg.dcm")
    again = cccd.read("back.seg.dcm", image="ct")
    assert dice(mask, scans.full(again)) > 0.985
    alone = cccd.read("back.seg.dcm")  # also without the series
    assert alone.frame.tilt == pytest.approx(18, abs=0.01)
    surface.write("back.dcm")
    normal, levels = planes_of(here / "ct")
    for contour in pydicom.dcmread("back.dcm").ROIContourSequence[0].ContourSequence:
        points = np.reshape([float(x) for x in contour.ContourData], (-1, 3)) @ normal
        assert np.abs(levels - points[:, None]).min(axis=1).max() < 2e-3  # it has three digits
        assert len(contour.ContourImageSequence) == 1
    drawn = cccd.reconstruct(cccd.read("back.dcm", image="ct"))
    assert drawn.volume == pytest.approx(surface.volume, rel=0.005)
    assert off(drawn.vertices).mean() < 0.15


@pytest.mark.parametrize("apart", ["missing", "uneven"])
def test_a_segmentation_on_uneven_slices_lies_at_its_heights(here, apart):
    affine, size = tilted(0, 2.0)
    heights = np.arange(size[2], dtype=float)
    if apart == "uneven":
        heights[1::2] += 0.4
        heights[2::3] += 0.25
        mask, changes = phantom(affine, size, heights), {"heights": heights}
    else:
        mask, changes = phantom(affine, size), {"skip": (8, 13)}
    series = scans.write_series(here / "ct", scans.grey(mask), affine, **changes)
    kept = [c for c in range(size[2]) if c not in changes.get("skip", ())]
    scans.write_seg(here / "mask.dcm", {"organ": mask[..., kept]}, series, ["organ"])
    structure = cccd.read("mask.dcm", image="ct")
    assert structure.warnings
    surface = cccd.reconstruct(structure)
    surface.write("back.seg.dcm")
    frames = pydicom.dcmread("back.seg.dcm").pixel_array
    filled = np.moveaxis(mask[..., kept], 2, 0)[mask[..., kept].any(axis=(0, 1))]
    assert dice(filled.sum(axis=0), frames.sum(axis=0).T > 0) > 0.97
    assert frames.sum() == pytest.approx(filled.sum(), rel=0.01)
    surface.write("back.dcm")
    normal, levels = planes_of(here / "ct")
    contours = pydicom.dcmread("back.dcm").ROIContourSequence[0].ContourSequence
    drawn = {round(np.reshape([float(x) for x in c.ContourData], (-1, 3))[0] @ normal, 2) for c in contours}
    there = {round(level, 2) for level in levels}
    assert drawn <= there or apart == "missing"
    assert surface.volume / 1000 == pytest.approx(TRUE_ML, rel=0.01)
    assert off(surface.vertices).mean() < 0.25


def test_contours_on_uneven_planes_lie_at_their_heights(here):
    angle = np.linspace(0, 2 * np.pi, 120, endpoint=False)
    heights = np.cumsum(np.random.default_rng(2).uniform(1.0, 3.0, 18)) - 17.6
    heights = heights[np.abs(heights) < 17.5]
    rings = [
        np.column_stack([s * RADII[0] * np.cos(angle), s * RADII[1] * np.sin(angle), np.full(120, z)])
        for z in heights
        if (s := np.sqrt(1 - (z / RADII[2]) ** 2))
    ]
    scans.write_structure_set(here / "rt.dcm", {"organ": rings})
    surface = cccd.reconstruct(cccd.read("rt.dcm"))
    assert surface.volume / 1000 == pytest.approx(TRUE_ML, rel=0.015)
    assert off(surface.vertices).mean() < 0.2


def test_uneven_and_missing_slices_of_a_series_are_interpolated_and_said(here):
    affine, size = tilted(0, 2.0)
    heights = np.arange(size[2], dtype=float)
    heights[9:] += 0.4
    index = np.moveaxis(np.indices(size), 0, -1).astype(float)
    index[..., 2] = heights
    world = index @ affine[:3, :3].T + affine[:3, 3]
    depth = (1 - np.linalg.norm(world / RADII, axis=-1)) * RADII.min()
    image = (100 * np.clip(depth / 2, -1, 1)).astype(np.int16)  # partial volume over 4 mm
    scans.write_series(here / "ct", image, affine, heights=heights)
    structure = cccd.read("ct", threshold=(0, None))
    assert any("unevenly spaced" in note for note in structure.warnings)
    assert cccd.reconstruct(structure).volume / 1000 == pytest.approx(TRUE_ML, rel=0.01)


def test_what_is_no_scanner_s_grid_is_refused():
    skewed = np.eye(4)
    skewed[0, 1] = skewed[1, 2] = skewed[2, 0] = 0.3
    flat = np.eye(4)
    flat[:3, 2] = (0, 0.999, 0.02)
    for affine in (skewed, flat):
        with pytest.raises(InputError, match=r"scan.nii: .*right angles"):
            check_affine(affine, "scan.nii")
    affine, _ = tilted(20, 1.0, pixel=1.0)
    assert find_slice_axis(affine) == 2
    assert "slice_axis" in refusal(find_slice_axis, affine, 0)


def test_even_grids_go_through_their_heights():
    rng = np.random.default_rng(0)
    for _ in range(50):
        heights = np.cumsum(rng.uniform(1, 4, 12))
        spacing, index = even_grid(heights)
        assert np.abs(heights - heights[0] - index * spacing).max() <= 0.05 * np.median(np.diff(heights))
        assert np.diff(index).min() > 0
    blocks = np.cumsum(np.r_[0, np.full(13, 4.002), 1.081, np.full(13, 6.999)])  # a head CT in two blocks
    assert len(blocks) <= even_grid(blocks)[1][-1] < 6 * len(blocks)
