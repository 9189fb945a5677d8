"""The real scans beside the project; they are not part of it, so each test skips where they are absent."""

import highdicom
import nibabel as nib
import numpy as np
import pydicom
import pytest
import shapely
import trimesh
from support import scans
from support.scans import DATA, empty_uids, full, referred

from cccd.cli import main
from cccd.containers import Curves, Sections
from cccd.settings.surface import LoftSettings
from cccd.surface.loft import loft_surface

if not DATA.is_dir():
    pytest.skip("the real scans are not at ../shared/data", allow_module_level=True)


def load(**columns):
    for name in ("image", "mask"):
        if columns.get(name) and not (DATA / columns[name]).exists():
            pytest.skip(f"{columns[name]} is not at ../shared/data")
    return scans.load(DATA, **columns)


#: Image, mask, label, slice axis, slice spacing in mm, slices with organ.
MASKS = [
    ("liver_totalseg_ct3mm/image.nii.gz", "liver_totalseg_ct3mm/labels.nii.gz", "5", 2, 3.0, 43),
    ("liver_totalseg_ct3mm/image.nii.gz", "liver_totalseg_ct3mm/labels.nii.gz", "2,3", 2, 3.0, 39),
    ("liver_totalseg_ct3mm/image.nii.gz", "liver_totalseg_ct3mm/labels.nii.gz", "20", 2, 3.0, 109),
    ("lung_cip64/image.nrrd", "lung_cip64/mask_lungs.nrrd", "", 2, 3.99, 69),
    ("brain_tcga_du7294/t1.nii.gz", "brain_tcga_du7294/mask_brain.nii.gz", "", 2, 1.0, 131),
    ("", "airway_lidc_1mm/mask_airway.nii.gz", "", 2, 1.0, 141),
    ("", "airway_lidc_1mm/mask_lungs.nii.gz", "", 2, 1.0, 236),
    # SliceThickness says 3 mm, the positions say 2; the labels were computed on 13 slices
    ("dicom_totalseg_liver20/dicom", "dicom_totalseg_liver20/labels.nii.gz", "5", 2, 38 / 12, 13),
]


@pytest.mark.parametrize(("image", "mask", "label", "axis", "spacing", "slices"), MASKS)
def test_masks(image, mask, label, axis, spacing, slices):
    structure = load(image=image, mask=mask, label=label)
    assert structure.frame.slice_axis == axis
    assert structure.frame.slice_spacing == pytest.approx(spacing, abs=0.01)
    assert structure.stack("mask").any(axis=(1, 2)).sum() == slices
    assert (structure.image is None) == (not image)


def test_dicom_and_nifti_masks_lie_at_the_same_place():
    """The NIfTI was made from the series by another program, which turned its rows over."""
    structure = load(image="dicom_totalseg_liver20/dicom", mask="dicom_totalseg_liver20/mask_liver.nii.gz")
    source = nib.load(DATA / "dicom_totalseg_liver20/mask_liver.nii.gz")
    there = np.argwhere(np.asarray(source.dataobj) > 0) @ source.affine[:3, :3].T + source.affine[:3, 3]
    frame = structure.frame
    here = np.argwhere(full(structure)) @ frame.affine[:3, :3].T + frame.affine[:3, 3]
    # it was copied from voxels of 3 mm, which are read; they reach 1.2 mm further along the slices
    assert frame.copied_to.shape == source.shape
    np.testing.assert_allclose(here.mean(axis=0), there.mean(axis=0), atol=0.2)
    np.testing.assert_allclose(here.std(axis=0), there.std(axis=0), atol=0.4)
    # liver enhances: its median lies well above water
    assert 40 < np.median(structure.image[structure.mask]) < 200


def test_what_goes_out_on_slices_whose_uids_an_anonymiser_blanked(tmp_path):
    """Class and instance stand in their files' headers alone; study and series nowhere."""
    folder = DATA / "dicom_totalseg_liver20"
    if not folder.exists():
        pytest.skip("dicom_totalseg_liver20 is not at ../shared/data")
    headers = [pydicom.dcmread(file, stop_before_pixels=True) for file in (folder / "dicom").iterdir()]
    assert not any(header.SOPClassUID or header.SeriesInstanceUID for header in headers)
    outputs = [tmp_path / name for name in ("liver.dcm", "liver.stl.dcm", "liver.seg.dcm")]
    asked = [str(folder / "mask_liver.nii.gz"), "--image", str(folder / "dicom")]
    assert main(["surface", *asked, *(part for path in outputs for part in ("-o", str(path)))]) == 0
    written = [pydicom.dcmread(path) for path in outputs]
    images = {
        (header.file_meta.MediaStorageSOPClassUID, header.file_meta.MediaStorageSOPInstanceUID)
        for header in headers
    }
    for dataset in written:
        assert empty_uids(dataset) == []
        assert referred(dataset) == images
    assert len({dataset.StudyInstanceUID for dataset in written}) == 1
    seg = highdicom.seg.segread(outputs[2])
    assert {uid for *_, uid in seg.get_source_image_uids()} == {uid for _, uid in images}
    row_of = {"image": "dicom_totalseg_liver20/dicom"}
    first, second = (load(**row_of, mask=str(path)) for path in (outputs[0], outputs[2]))
    assert first.contours is not None
    assert full(second).sum() == seg.get_volume().array.sum()


#: ROI, contours that enclose an area, slices.
ROIS = [("Lt Lung", 165, 80), ("Heart", 33, 33), ("BODY", 141, 98), ("Breast", 48, 47)]


@pytest.mark.parametrize(("roi", "contours", "slices"), ROIS)
def test_structure_set(roi, contours, slices):
    folder = "dicom_rtstruct_dicompyler"
    structure = load(image=f"{folder}/dicom", mask=f"{folder}/rtstruct.dcm", label=roi)
    curves = structure.contours
    assert len(curves) == contours
    assert len(np.unique(curves.slice)) == slices
    assert structure.frame.slice_spacing == pytest.approx(3.0, abs=1e-3)
    assert all(shapely.LinearRing(points).is_simple for points in curves)
    # its one slice of CT does not say where the scan ends, so nothing is cut
    assert curves.slice.min() == 1
    assert curves.slice.max() == structure.frame.shape[2] - 2


def test_a_structure_set_keeps_its_volume_in_one_piece():
    """Of contours with holes and islands, none is lost on the way to the surface."""
    whole = load(mask="dicom_rtstruct_dicompyler/rtstruct.dcm", label="Lt Lung").contours
    some = (whole.slice > 27) & (whole.slice < 38)  # those with three contours and more
    polygons = whole.polygons.take(some)
    curves = Curves(polygons.points, polygons.offsets, whole.slice[some], whole.hole[some], whole.frame)
    assert curves.hole.sum() > 25
    signed = [x @ np.roll(y, -1) - y @ np.roll(x, -1) for x, y in (points.T for points in curves)]
    drawn = sum(signed) / 2 * float(curves.frame.spacing.prod())
    surface = loft_surface(Sections(curves), LoftSettings())
    volumes = [part.volume for part in trimesh.Trimesh(surface.vertices, surface.faces).split()]
    assert sum(volumes) == pytest.approx(drawn, rel=0.01)
    assert max(volumes) == pytest.approx(drawn, rel=0.01)
