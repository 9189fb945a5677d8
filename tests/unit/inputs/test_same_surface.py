"""The same organ as label map, SEG and RTSTRUCT gives the same surface."""

import cv2
import numpy as np
import pytest
import pyvista
from support.scans import (
    outlines,
    row,
    settings,
    write_itk,
    write_nifti,
    write_seg,
    write_series,
    write_structure_set,
)

from cccd.containers import Curves, Sections
from cccd.geometry.arrays import concatenate_ragged
from cccd.inputs import load_structure
from cccd.settings.surface import LoftSettings
from cccd.surface import loft_surface


def traced(structure):
    """Borders of the mask as ordered curves, by OpenCV."""
    k0, i0, j0 = structure.stack_origin
    points, slices, holes = [], [], []
    for k, plane in enumerate(structure.stack("mask"), start=k0):
        borders, tree = cv2.findContours(plane.astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
        for border, (_, _, _, parent) in zip(borders, tree[0] if borders else (), strict=True):
            ring = border[:, 0, ::-1] + np.array((i0, j0), float)
            x, y = ring.T
            outwards = x @ np.roll(y, -1) - y @ np.roll(x, -1) > 0
            points.append(ring if outwards != (parent >= 0) else ring[::-1])
            slices.append(k)
            holes.append(parent >= 0)
    stacked, offsets = concatenate_ragged(points)
    return Curves(stacked, offsets, np.array(slices, np.int32), np.array(holes), structure.frame)


def average_distance(first, second):
    """Average symmetric surface distance between two meshes, from their vertices, in mm."""
    meshes = [pyvista.PolyData.from_regular_faces(mesh.vertices, mesh.faces) for mesh in (first, second)]
    ways = (meshes, meshes[::-1])
    return np.mean([np.abs(a.compute_implicit_distance(b)["implicit_distance"]).mean() for a, b in ways])


def test_four_formats_one_surface(tmp_path):
    scanner = {"spacing_mm": [1.0, 1.0, 4.0]}
    kidney = load_structure(row(source="phantom", organ="kidney"), ".", settings(phantom=scanner))
    affine = kidney.frame.affine.copy()
    affine[:3, 3] += affine[:3, :3] @ kidney.origin
    series = write_series(tmp_path / "dicom", kidney.image.astype(np.int16), affine)
    write_nifti(tmp_path / "mask.nii.gz", kidney.mask.astype(np.uint8), affine)
    write_itk(tmp_path / "mask.nrrd", kidney.mask.astype(np.uint8), affine)
    write_seg(tmp_path / "seg.dcm", {"organ": kidney.mask}, series, ["organ"])
    write_structure_set(tmp_path / "rt.dcm", {"organ": outlines(kidney.mask, affine)})
    surfaces = {}
    for mask in ("mask.nii.gz", "mask.nrrd", "seg.dcm", "rt.dcm"):
        structure = load_structure(row(image="dicom", mask=mask), tmp_path, settings())
        curves = structure.contours if structure.contours is not None else traced(structure)
        surfaces[mask] = loft_surface(Sections(curves), LoftSettings())
    for mask in ("mask.nrrd", "seg.dcm"):
        # headers keep more or fewer digits of the affine
        np.testing.assert_allclose(surfaces[mask].vertices, surfaces["mask.nii.gz"].vertices, atol=1e-3)
    # a tenth of a voxel, by its shortest edge
    assert average_distance(surfaces["rt.dcm"], surfaces["mask.nii.gz"]) == pytest.approx(0, abs=0.1)
