"""The same organ as label map, SEG and RTSTRUCT gives the same surface."""

import numpy as np
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

from cccd.containers import Sections
from cccd.inputs import load_structure
from cccd.metrics import surface_distances
from cccd.settings.surface import LoftSettings
from cccd.surface.loft import loft_surface
from cccd.tracing import trace_mask


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
        curves = trace_mask(structure) if structure.contours is None else structure.contours
        surfaces[mask] = loft_surface(Sections(curves), LoftSettings())
    for mask in ("mask.nrrd", "seg.dcm"):
        # headers keep more or fewer digits of the affine
        np.testing.assert_allclose(surfaces[mask].vertices, surfaces["mask.nii.gz"].vertices, atol=1e-3)
    # a tenth of a voxel, by its shortest edge
    meshes = surfaces["rt.dcm"].mesh, surfaces["mask.nii.gz"].mesh
    assert surface_distances(*meshes, np.random.default_rng(0), 5000)["assd"] < 0.1
