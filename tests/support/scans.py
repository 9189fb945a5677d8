"""Small scans written with the libraries that real ones are written with."""

from pathlib import Path

import highdicom
import nibabel as nib
import numpy as np
import pydicom
import SimpleITK as sitk  # noqa: N813
from pydicom.datadict import tag_for_keyword
from pydicom.dataset import Dataset, FileDataset, FileMetaDataset
from pydicom.sr.codedict import codes
from pydicom.uid import (
    CTImageStorage,
    EnhancedCTImageStorage,
    ExplicitVRLittleEndian,
    RTStructureSetStorage,
    generate_uid,
)
from scipy.spatial.transform import Rotation
from skimage.measure import find_contours

from cccd.containers import Structure
from cccd.inputs import Request, read_request
from cccd.settings.imports import ImportSettings
from support import ROOT

DATA = ROOT.parent / "shared" / "data"
#: What studies are referred to by, retired (PS3.6, annex A).
STUDY_CLASS = "1.2.840.10008.3.1.2.3.1"
FLIP = np.diag([-1.0, -1.0, 1.0, 1.0])


def dicom_file(sop_class, entropy):
    """Empty DICOM file of a kind; its instance UID follows from ``entropy``."""
    meta = FileMetaDataset()
    meta.MediaStorageSOPClassUID = sop_class
    meta.MediaStorageSOPInstanceUID = generate_uid(entropy_srcs=entropy)
    meta.TransferSyntaxUID = ExplicitVRLittleEndian
    ds = FileDataset(None, {}, file_meta=meta, preamble=b"\0" * 128)
    ds.SOPClassUID, ds.SOPInstanceUID = sop_class, meta.MediaStorageSOPInstanceUID
    return ds


def settings(**changes):
    """The default settings of the import, but for some changes."""
    return ImportSettings(**changes)


def load_structure(columns, folder, asked, seed=0) -> Structure:
    """The structure of a row of a sheet in the folder."""
    return read_request(Request.of_row(columns, Path(folder)), asked, seed)


def row(**columns):
    return {
        "case": "case",
        "organ": "organ",
        "source": "files",
        "image": "",
        "mask": "",
        "label": "",
        "boundary": "",
        "role": "both",
        "location": "cohort.tsv row 2",
        **columns,
    }


def load(folder, changes=None, **columns):
    """The structure of a row of a sheet in a folder; ``changes`` are those of the import's settings."""
    return load_structure(row(**columns), folder, settings(**(changes or {})))


def affine_of(spacing=(1.5, 1.2, 4.0), turn=(0.0, 0.0, 0.0), mirror=False, origin=(-30.0, 12.0, 7.0)):
    """RAS affine; ``mirror`` makes it left-handed."""
    affine = np.eye(4)
    affine[:3, :3] = Rotation.from_euler("xyz", turn, degrees=True).as_matrix() * spacing
    if mirror:
        affine[:3, 0] *= -1
    affine[:3, 3] = origin
    return affine


def dicom_affine(**kwargs):
    """As a scanner's series: columns to the left, rows to the back, slices to the head."""
    return affine_of(**kwargs) @ np.diag([-1.0, -1.0, 1.0, 1.0])


def organ(shape=(44, 38, 14)):
    """Boolean organ: an ellipsoid with a hole through some slices, and a small neighbour."""
    a, b, c = np.indices(shape, float)
    body = ((a - 18) / 13) ** 2 + ((b - 18) / 12) ** 2 + ((c - 6.5) / 5) ** 2 < 1
    hole = ((a - 17) / 4) ** 2 + ((b - 19) / 3) ** 2 + ((c - 6) / 2.2) ** 2 < 1
    neighbour = ((a - 37) / 4.2) ** 2 + ((b - 10) / 5) ** 2 + ((c - 7) / 3.2) ** 2 < 1
    return (body & ~hole) | neighbour


def chest(shape=(60, 50, 20)):
    """HU of a body in air, and its lungs."""
    a, b, _ = np.indices(shape, float)
    image = np.full(shape, -1000, np.int16)
    image[((a - 30) / 26) ** 2 + ((b - 25) / 21) ** 2 < 1] = 40
    lungs = (np.minimum(abs(a - 18), abs(a - 42)) / 8) ** 2 + ((b - 25) / 13) ** 2 < 1
    image[lungs] = -850
    return image, lungs


def grey(mask, seed=0):
    noise = np.random.default_rng(seed).normal(0, 5, mask.shape)
    return np.round(np.where(mask, 100, -50) + noise).astype(np.int16)


def write_nifti(path, data, affine):
    image = nib.Nifti1Image(data, affine)
    image.set_sform(affine, code=1)
    nib.save(image, path)
    return path


def write_itk(path, data, affine):
    lps = FLIP @ affine
    spacing = np.linalg.norm(lps[:3, :3], axis=0)
    image = sitk.GetImageFromArray(np.ascontiguousarray(data.T))
    image.SetSpacing(spacing.tolist())
    image.SetDirection((lps[:3, :3] / spacing).ravel().tolist())
    image.SetOrigin(lps[:3, 3].tolist())
    sitk.WriteImage(image, str(path), useCompression=True)
    return path


def write_series(
    folder, data, affine, thickness=None, skip=(), compress=False, uid="series", heights=None, modality="CT"
):
    """One CT file per slice; ``heights`` moves slices along the normal (in slice spacings)."""
    folder.mkdir(parents=True, exist_ok=True)
    lps = FLIP @ affine
    spacing = np.linalg.norm(lps[:3, :3], axis=0)
    directions = lps[:3, :3] / spacing
    series = []
    for c in range(data.shape[2]):
        if c in skip:
            continue
        height = c if heights is None else heights[c]
        ds = dicom_file(CTImageStorage, [uid, str(c)])
        ds.PatientName, ds.PatientID, ds.PatientBirthDate, ds.PatientSex = "Test^Anna", "T1", "", "F"
        ds.StudyInstanceUID = generate_uid(entropy_srcs=["study"])
        ds.SeriesInstanceUID = generate_uid(entropy_srcs=[uid]) if uid else ""
        ds.FrameOfReferenceUID = generate_uid(entropy_srcs=["frame"])
        ds.StudyDate, ds.StudyTime, ds.StudyID, ds.AccessionNumber = "20200101", "000000", "1", ""
        ds.ReferringPhysicianName, ds.Manufacturer, ds.Modality = "", "", modality
        ds.SeriesNumber, ds.InstanceNumber, ds.SeriesDescription = 1, 100 - c, uid
        ds.PositionReferenceIndicator = ""
        ds.ImagePositionPatient = [f"{x:.6f}" for x in lps[:3, 3] + lps[:3, 2] * height]
        ds.ImageOrientationPatient = [f"{x:.8f}" for x in directions[:, :2].T.ravel()]
        ds.PixelSpacing = [f"{spacing[1]:.6f}", f"{spacing[0]:.6f}"]
        ds.SliceThickness = str(spacing[2] if thickness is None else thickness)
        ds.Rows, ds.Columns = data.shape[1], data.shape[0]
        ds.SamplesPerPixel, ds.PhotometricInterpretation = 1, "MONOCHROME2"
        ds.BitsAllocated, ds.BitsStored, ds.HighBit, ds.PixelRepresentation = 16, 16, 15, 1
        ds.RescaleSlope, ds.RescaleIntercept = "2", "-1000"
        ds.PixelData = ((data[:, :, c].astype(int) + 1000) // 2).astype(np.int16).T.tobytes()
        if compress:
            ds.compress(pydicom.uid.JPEG2000Lossless)
        # names out of order: only positions tell the order
        ds.save_as(folder / f"{(7 * c) % 100:03d}.dcm", enforce_file_format=True)
        series.append(ds)
    return series


def empty_uids(dataset):
    """Keywords of the UIDs in a data set, at any depth, that name nothing."""
    found = [element.keyword for element in dataset.iterall() if element.VR == "UI" and not element.value]
    return [*found, *(element.keyword for element in dataset.file_meta if not element.value)]


def referred(dataset):
    """Class and instance of all images that a data set refers to."""
    items = [part for element in dataset.iterall() if element.VR == "SQ" for part in element.value]
    uids = {
        (part.ReferencedSOPClassUID, part.ReferencedSOPInstanceUID)
        for part in items
        if "ReferencedSOPInstanceUID" in part
    }
    return {(kind, uid) for kind, uid in uids if kind != STUDY_CLASS}


def item(**attributes):
    """A dataset with these attributes."""
    dataset = Dataset()
    for keyword, value in attributes.items():
        setattr(dataset, keyword, value)
    return dataset


def write_enhanced(path, data, affine, frames):
    """Enhanced (multi-frame) CT; ``frames`` are the slices in the order in which they stand in the file."""
    lps = FLIP @ affine
    spacing = np.linalg.norm(lps[:3, :3], axis=0)
    directions = lps[:3, :3] / spacing
    ds = dicom_file(EnhancedCTImageStorage, ["enhanced"])
    ds.Modality, ds.NumberOfFrames = "CT", len(frames)
    ds.StudyInstanceUID = generate_uid(entropy_srcs=["study"])
    ds.SeriesInstanceUID = generate_uid(entropy_srcs=["enhanced series"])
    ds.FrameOfReferenceUID = generate_uid(entropy_srcs=["frame"])
    ds.Rows, ds.Columns = data.shape[1], data.shape[0]
    ds.SamplesPerPixel, ds.PhotometricInterpretation = 1, "MONOCHROME2"
    ds.BitsAllocated, ds.BitsStored, ds.HighBit, ds.PixelRepresentation = 16, 16, 15, 1
    orientation = item(ImageOrientationPatient=[f"{x:.8f}" for x in directions[:, :2].T.ravel()])
    # a thickness that lies, as it does where slices overlap
    measures = item(PixelSpacing=[f"{spacing[1]:.6f}", f"{spacing[0]:.6f}"], SliceThickness="9")
    rescale = item(RescaleSlope="2", RescaleIntercept="-1000", RescaleType="HU")
    ds.SharedFunctionalGroupsSequence = [
        item(
            PlaneOrientationSequence=[orientation],
            PixelMeasuresSequence=[measures],
            PixelValueTransformationSequence=[rescale],
        )
    ]
    ds.PerFrameFunctionalGroupsSequence = [
        item(
            PlanePositionSequence=[
                item(ImagePositionPatient=[f"{x:.6f}" for x in lps[:3, 3] + lps[:3, 2] * c])
            ],
            FrameContentSequence=[item(InStackPositionNumber=number, DimensionIndexValues=[number])],
        )
        for number, c in enumerate(frames, start=1)
    ]
    organization = generate_uid(entropy_srcs=["dimensions"])
    ds.DimensionOrganizationSequence = [item(DimensionOrganizationUID=organization)]
    ds.DimensionIndexSequence = [
        item(
            DimensionOrganizationUID=organization,
            DimensionIndexPointer=tag_for_keyword("InStackPositionNumber"),
            FunctionalGroupPointer=tag_for_keyword("FrameContentSequence"),
        )
    ]
    stored = ((data.astype(int) + 1000) // 2).astype(np.int16)
    ds.PixelData = b"".join(stored[:, :, c].T.tobytes() for c in frames)
    ds.save_as(path, enforce_file_format=True)
    return path


def write_seg(path, masks, series, names):
    """A DICOM SEG of masks {name: (a, b, c) bool} on a series."""
    algorithm = highdicom.AlgorithmIdentificationSequence("test", codes.DCM.ArtificialIntelligence, "1")
    described = [
        highdicom.seg.SegmentDescription(
            number, name, codes.SCT.Organ, codes.SCT.Liver, "AUTOMATIC", algorithm_identification=algorithm
        )
        for number, name in enumerate(names, start=1)
    ]
    pixels = np.stack([masks[name] for name in names], axis=-1).transpose(2, 1, 0, 3).astype(np.uint8)
    seg = highdicom.seg.Segmentation(
        source_images=series,
        pixel_array=pixels,
        segmentation_type="BINARY",
        segment_descriptions=described,
        series_instance_uid=generate_uid(entropy_srcs=["seg"]),
        series_number=2,
        sop_instance_uid=generate_uid(entropy_srcs=["seg", "1"]),
        instance_number=1,
        manufacturer="test",
        manufacturer_model_name="test",
        software_versions="1",
        device_serial_number="1",
    )
    seg.save_as(path)
    return path


def outlines(mask, affine):
    """Outlines of a mask, slice by slice, as RTSTRUCT contours (n, 3) in world mm (LPS)."""
    contours = []
    for c in range(mask.shape[2]):
        for loop in find_contours(np.pad(mask[:, :, c].astype(float), 1), 0.5):
            index = np.column_stack([loop[:-1] - 1, np.full(len(loop) - 1, c)])
            contours.append(index @ (FLIP @ affine)[:3, :3].T + (FLIP @ affine)[:3, 3])
    return contours


def write_structure_set(path, rois, kind="CLOSED_PLANAR"):
    """RTSTRUCT with rois {name: contours in LPS}."""
    ds = dicom_file(RTStructureSetStorage, ["rt"])
    ds.Modality = "RTSTRUCT"
    ds.FrameOfReferenceUID = generate_uid(entropy_srcs=["frame"])
    ds.StructureSetROISequence, ds.ROIContourSequence = [], []
    for number, (name, contours) in enumerate(rois.items(), start=1):
        roi, content = Dataset(), Dataset()
        roi.ROINumber, roi.ROIName = number, name
        content.ReferencedROINumber = number
        content.ContourSequence = []
        for points in contours:
            contour = Dataset()
            contour.ContourGeometricType = kind
            contour.NumberOfContourPoints = len(points)
            contour.ContourData = [f"{x:.5f}" for x in np.asarray(points).ravel()]
            content.ContourSequence.append(contour)
        ds.StructureSetROISequence.append(roi)
        ds.ROIContourSequence.append(content)
    ds.save_as(path, enforce_file_format=True)
    return path


def full(structure, name="mask"):
    """The array put back onto the source grid; nothing may lie outside."""
    array, shape = getattr(structure, name), structure.frame.shape
    first = np.maximum(structure.origin, 0)
    last = np.minimum(structure.origin + array.shape, shape)
    inner = tuple(slice(a, b) for a, b in zip(first - structure.origin, last - structure.origin, strict=True))
    whole = np.zeros(shape, array.dtype)
    whole[tuple(slice(a, b) for a, b in zip(first, last, strict=True))] = array[inner]
    if array.dtype == bool:
        assert whole.sum() == array.sum()
    return whole


def inside(curves, shape):
    """Rasterise curves (even-odd at pixel centres) onto a volume with slices along the last axis."""
    from matplotlib.path import Path as Outline

    grid = np.stack(np.indices(shape[:2]), -1).reshape(-1, 2)
    mask = np.zeros(shape, bool)
    for points, k in zip(curves, curves.slice, strict=True):
        mask[:, :, k] ^= Outline(np.vstack([points, points[:1]])).contains_points(grid).reshape(shape[:2])
    return mask
