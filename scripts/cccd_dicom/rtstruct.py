"""The surface as contours on the scan's slices (RTSTRUCT), in LPS as DICOM demands.

That no half file is left is the caller's to see to (`cccd.store.atomic_path`).
"""

from __future__ import annotations

import hashlib
import logging
from collections import Counter
from functools import cache
from pathlib import Path

import numpy as np
import pydicom
from pydicom.dataset import Dataset, FileMetaDataset
from pydicom.errors import InvalidDicomError
from pydicom.sequence import Sequence
from pydicom.uid import (
    UID,
    ExplicitVRLittleEndian,
    ImplicitVRLittleEndian,
    RTStructureSetStorage,
    generate_uid,
)

from cccd.errors import InputError
from cccd.files import ExportOptions
from cccd.geometry.arrays import FloatArray
from cccd.geometry.sections import cross_sections
from cccd.inputs.grid import LPS_TO_RAS
from cccd.surface.surface import LoftedSurface
from cccd_dicom.readers import NO_IMAGES, known_uid, sop_uid
from cccd_dicom.slices import CONTOUR_PLANE

logger = logging.getLogger(__name__)
_warn_once = cache(logger.warning)  # a series is read for each file that refers to it


def write(path: Path, surface: LoftedSurface, options: ExportOptions) -> None:
    """Write the mesh as one ROI of an RTSTRUCT: closed loops, whose nesting says what is a hole.

    Planes are parallel to the slices of the file's grid, and counted from the first of them. With
    ``options.series`` study, frame of reference and the slices themselves are referred to by their UIDs;
    otherwise the object refers to no other.

    Raises
    ------
    InputError
        No DICOM images in the series, or the planes miss the mesh.
    """
    mesh, frame, spacing_mm = surface.mesh, surface.frame.of_file, options.settings.contour_spacing_mm
    normal = frame.normal
    spacing = frame.slice_spacing if spacing_mm is None else spacing_mm
    base = frame.affine[:3, 3] @ normal
    level = mesh.vertices @ normal
    first, last = np.floor((level.min() - base) / spacing), np.ceil((level.max() - base) / spacing)
    heights = base + spacing * np.arange(first, last + 1)
    slices = [] if options.series is None else reference_slices(options.series)
    if spacing_mm is None:
        heights = _own_heights(_levels(slices, normal), spacing, heights)
    sections = cross_sections(mesh, normal, heights)
    loops = [
        (float(height), _rounded(loop @ LPS_TO_RAS[:3, :3]))
        for height, section in zip(heights, sections, strict=True)
        for loop in section
    ]
    loops = [(height, loop) for height, loop in loops if len(loop) >= 3]
    if not loops:
        raise InputError(str(path), "no plane meets the surface", "choose a smaller spacing_mm")
    dataset = _structure_set(loops, options.organ, slices, normal, spacing)
    if options.settings.keep_patient and slices:
        copy_identity(slices[0], dataset)
    dataset.save_as(path, enforce_file_format=True)


def _rounded(loop: FloatArray) -> FloatArray:
    """Round to the digits that are written, and drop points equal to their predecessor."""
    rounded = np.round(loop, 3)
    return rounded[np.abs(np.diff(rounded, axis=0, prepend=rounded[-1:])).max(axis=1) > 0]


#: What the images of a series have in common, and a reference to them names.
_COMMON = ("StudyInstanceUID", "SeriesInstanceUID", "FrameOfReferenceUID")


def reference_slices(folder: Path) -> list[Dataset]:
    """Read the headers of the DICOM images under a folder, with every UID that a reference to them needs.

    Where the images have no study, series or frame of reference, one is made up that follows from them, so
    that all that refers to them names the same.

    Raises
    ------
    InputError
        No DICOM images there, or one that does not say which image it is, or says what another one says.
    """
    found: list[Dataset] = []
    for file in sorted(item for item in folder.rglob("*") if item.is_file()):
        try:
            header = pydicom.dcmread(file, stop_before_pixels=True)
        except (InvalidDicomError, OSError):
            continue
        if header.get("ImagePositionPatient") and header.get("Modality") not in NO_IMAGES:
            for keyword in ("SOPClassUID", "SOPInstanceUID"):
                setattr(header, keyword, _own_uid(header, keyword, file))
            found.append(header)
    if not found:
        raise InputError(
            folder.name, "no DICOM images in this folder", "give the folder of the source series"
        )
    _refuse_namesakes(found, folder.name)
    _complete_common_uids(found, str(folder))
    return found


def _refuse_namesakes(slices: list[Dataset], location: str) -> None:
    """Refuse images that nothing can tell apart."""
    uid, count = Counter(image.SOPInstanceUID for image in slices).most_common(1)[0]
    if count > 1:
        raise InputError(
            location,
            f"{count} of its images have one SOPInstanceUID, {uid}",
            "export the series again, or choose a format other than DICOM",
        )


def _own_uid(image: Dataset, keyword: str, file: Path) -> str:
    """Class or instance of an image, without which nothing can refer to it."""
    uid = sop_uid(image, keyword)
    if not uid:
        raise InputError(
            str(file), f"it has no {keyword}", "export the series again, or choose a format other than DICOM"
        )
    return uid


def _complete_common_uids(slices: list[Dataset], location: str) -> None:
    """Write what the images of a series have in common into those that lack it."""
    instances = sorted(image.SOPInstanceUID for image in slices)
    made_up: list[str] = []
    for keyword in _COMMON:
        uid = next((image[keyword].value for image in slices if known_uid(image.get(keyword))), None)
        if uid is None:
            uid = generate_uid(entropy_srcs=[*instances, keyword])
            made_up.append(keyword)
        for image in slices:
            if not known_uid(image.get(keyword)):
                setattr(image, keyword, uid)
    if made_up:
        _warn_once("%s: its images have no %s; the references use new ones", location, ", ".join(made_up))


def item_of(**attributes: object) -> Dataset:
    """Make a DICOM data set of elements by keyword."""
    dataset = Dataset()
    for keyword, value in attributes.items():
        setattr(dataset, keyword, value)
    return dataset


def references_to(slices: list[Dataset]) -> list[Dataset]:
    """Items that refer to images by class and instance."""
    return [
        item_of(ReferencedSOPClassUID=image.SOPClassUID, ReferencedSOPInstanceUID=image.SOPInstanceUID)
        for image in slices
    ]


#: What identifies patient and study.
_IDENTITY = (
    *("PatientName", "PatientID", "PatientBirthDate", "PatientSex"),
    *("StudyDate", "StudyTime", "StudyID", "AccessionNumber", "ReferringPhysicianName"),
)

#: SOP class of a study, retired from the standard and still what an RTSTRUCT refers to (PS3.3, C.8.8.5).
_STUDY_CLASS = "1.2.840.10008.3.1.2.3.1"


def _structure_set(
    loops: list[tuple[float, FloatArray]],
    name: str,
    slices: list[Dataset],
    normal: FloatArray,
    spacing: float,
) -> Dataset:
    """Assemble the RTSTRUCT of loops (n, 3) in LPS mm at heights along the normal."""
    # UIDs follow from the content, so that equal surfaces have equal bytes.
    source = slices[0] if slices else Dataset()
    dataset = identified_dataset(RTStructureSetStorage, "RTSTRUCT", source, _digest(loops, name, source))
    # with explicit types a contour of more than 64 kB has none, and few programs read it
    dataset.file_meta.TransferSyntaxUID = ImplicitVRLittleEndian
    dataset.OperatorsName = ""
    dataset.StructureSetLabel = name[:16]
    dataset.StructureSetDate = dataset.StructureSetTime = ""
    dataset.ApprovalStatus = "UNAPPROVED"
    images = references_to(slices)
    dataset.ReferencedFrameOfReferenceSequence = Sequence([_frame_of_reference(dataset, source, images)])
    dataset.StructureSetROISequence = Sequence(
        [
            item_of(
                ROINumber=1,
                ReferencedFrameOfReferenceUID=dataset.FrameOfReferenceUID,
                ROIName=name,
                ROIGenerationAlgorithm="AUTOMATIC",
            )
        ]
    )
    contours = _contour_items(loops, _levels(slices, normal), images, CONTOUR_PLANE * spacing)
    dataset.ROIContourSequence = Sequence(
        [item_of(ReferencedROINumber=1, ROIDisplayColor=[220, 60, 50], ContourSequence=Sequence(contours))]
    )
    dataset.RTROIObservationsSequence = Sequence(
        [item_of(ObservationNumber=1, ReferencedROINumber=1, RTROIInterpretedType="ORGAN", ROIInterpreter="")]
    )
    return dataset


def _digest(loops: list[tuple[float, FloatArray]], name: str, source: Dataset) -> str:
    """SHA-256 of everything that an RTSTRUCT is made of."""
    digest = hashlib.sha256(name.encode())
    for _, loop in loops:
        digest.update(loop.tobytes())
    digest.update(str(source.get("SeriesInstanceUID", "")).encode())
    return digest.hexdigest()


def identified_dataset(sop_class: UID, modality: str, source: Dataset, seed: str) -> Dataset:
    """Object of study and frame of reference of the source, and of nobody.

    UIDs follow from ``seed``.
    """

    def uid(part: str) -> UID:
        return generate_uid(entropy_srcs=[seed, part])

    dataset = Dataset()
    dataset.file_meta = FileMetaDataset()
    dataset.file_meta.MediaStorageSOPClassUID = sop_class
    dataset.file_meta.MediaStorageSOPInstanceUID = uid("instance")
    dataset.file_meta.TransferSyntaxUID = ExplicitVRLittleEndian
    dataset.SOPClassUID = sop_class
    dataset.SOPInstanceUID = uid("instance")
    dataset.Modality = modality
    dataset.SeriesInstanceUID = uid("series")
    dataset.StudyInstanceUID = str(source.get("StudyInstanceUID") or uid("study"))
    for keyword in _IDENTITY:  # the standard wants them there, be they empty
        setattr(dataset, keyword, "")
    dataset.SeriesNumber = None
    dataset.Manufacturer = "CCCD"
    dataset.FrameOfReferenceUID = str(source.get("FrameOfReferenceUID") or uid("frame"))
    dataset.PositionReferenceIndicator = ""
    return dataset


def copy_identity(source: Dataset, dataset: Dataset) -> None:
    """Write who the patient is, and which study it was, into a data set."""
    if source.get("SpecificCharacterSet"):
        dataset.SpecificCharacterSet = source.SpecificCharacterSet
    for keyword in _IDENTITY:
        setattr(dataset, keyword, source.get(keyword, ""))


def _frame_of_reference(dataset: Dataset, source: Dataset, images: list[Dataset]) -> Dataset:
    """Refer to the frame of reference, and to study, series and images where there are any."""
    frame = item_of(FrameOfReferenceUID=dataset.FrameOfReferenceUID)
    if images:
        series = item_of(SeriesInstanceUID=source.SeriesInstanceUID, ContourImageSequence=Sequence(images))
        study = item_of(
            ReferencedSOPClassUID=_STUDY_CLASS,
            ReferencedSOPInstanceUID=dataset.StudyInstanceUID,
            RTReferencedSeriesSequence=Sequence([series]),
        )
        frame.RTReferencedStudySequence = Sequence([study])
    return frame


def _levels(slices: list[Dataset], normal: FloatArray) -> FloatArray:
    """Heights (S,) of slices along a normal (3,) in RAS, mm."""
    positions = np.array([[float(x) for x in item.ImagePositionPatient] for item in slices]).reshape(-1, 3)
    return positions @ LPS_TO_RAS[:3, :3] @ normal


def _own_heights(levels: FloatArray, spacing: float, heights: FloatArray) -> FloatArray:
    """Heights of a series' slices (S,) where these are uneven: the frame's (P,) then lie much closer."""
    gaps = np.diff(np.sort(levels))
    finer = len(gaps) > 0 and np.median(gaps) > 1.5 * spacing
    return np.sort(levels) if finer else heights


def _contour_items(
    loops: list[tuple[float, FloatArray]], levels: FloatArray, images: list[Dataset], tolerance_mm: float
) -> list[Dataset]:
    """Write loops as contours; one within the tolerance of an image's level refers to that image."""
    contours = []
    for height, loop in loops:
        contour = item_of(
            ContourGeometricType="CLOSED_PLANAR",
            NumberOfContourPoints=len(loop),
            ContourData=[f"{x:.3f}" for x in loop.ravel()],
        )
        near = np.flatnonzero(np.abs(levels - height) <= tolerance_mm)
        if len(near):
            contour.ContourImageSequence = Sequence([images[near[0]]])
        contours.append(contour)
    return contours
