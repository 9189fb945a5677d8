"""The folder of phantoms that others use: what the files say is what was scanned, and the same every time."""

import numpy as np
import pytest
from support.scans import row, settings

from cccd.geometry.ply import read_ply
from cccd.inputs import load_structure
from cccd.settings.imports import PHANTOM_ORGANS
from cccd_datasets.phantoms import ORGANS, make_phantom
from cccd_paper.phantom_files import describe_scan, write_scan, write_truth


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
    read = load_structure(row(image="image.nii.gz", mask="mask.nii.gz"), tmp_path / "first", settings())
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
