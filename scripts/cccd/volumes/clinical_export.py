"""Back to the clinic's formats: the surface as a label map (NIfTI) and as contours (RTSTRUCT).

NIfTI is written in RAS on the source volume's own grid, RTSTRUCT in LPS as DICOM demands, so that both lie
on the scan in any viewer.
"""

from __future__ import annotations

import gzip
import hashlib
from pathlib import Path

import nibabel as nib
import numpy as np
import pydicom
from pydicom.dataset import Dataset, FileDataset, FileMetaDataset
from pydicom.sequence import Sequence
from pydicom.uid import ExplicitVRLittleEndian, RTStructureSetStorage, generate_uid

from cccd.containers import Frame
from cccd.errors import InputError
from cccd.geometry.mesh import Mesh
from cccd.geometry.raster import voxelise
from cccd.geometry.sections import cross_sections
from cccd.store import atomic_path
from cccd.tolerances import CONTOUR_PLANE
from cccd.volumes.grid import LPS_TO_RAS

__all__ = ["write_label_map", "write_rtstruct"]


def write_label_map(path: str | Path, mesh: Mesh, frame: Frame, value: int = 1) -> None:
    """Write the voxels inside a closed mesh as NIfTI label map on the source grid.

    Parameters
    ----------
    path : path
        ``.nii`` or ``.nii.gz``.
    mesh : Mesh
        Closed, in mm RAS.
    frame : Frame
        The source volume's grid.
    value : int
        Label of the voxels inside, 1 to 255.
    """
    mask = voxelise(mesh, frame.affine, frame.shape)
    image = nib.Nifti1Image(mask.astype(np.uint8) * np.uint8(value), frame.affine)
    image.set_sform(frame.affine, code=1)
    image.set_qform(frame.affine, code=1)
    image.header.set_xyzt_units("mm")
    path = Path(path)
    suffix = ".nii.gz" if path.name.endswith(".gz") else ".nii"
    with atomic_path(path) as temporary:
        # the temporary name may end with .gz alone, by which nibabel would not know the format
        content = image.to_bytes()
        if suffix == ".nii.gz":
            content = gzip.compress(content, compresslevel=6, mtime=0)
        temporary.write_bytes(content)


def _thinned(loop: np.ndarray) -> np.ndarray:
    """Drop points nearer to their predecessor than DICOM's written digits can tell apart."""
    rounded = np.round(loop, 3)
    return rounded[np.abs(np.diff(rounded, axis=0, prepend=rounded[-1:])).max(axis=1) > 0]


def write_rtstruct(
    path: str | Path,
    mesh: Mesh,
    frame: Frame,
    *,
    name: str,
    spacing_mm: float | None = None,
    reference: str | Path | None = None,
) -> None:
    """Write a closed mesh as one ROI of a DICOM RTSTRUCT.

    Parameters
    ----------
    path : path
        Where.
    mesh : Mesh
        Closed, in mm RAS.
    frame : Frame
        The source volume's grid; planes are parallel to its slices.
    name : str
        The ROI's name.
    spacing_mm : float, optional
        Distance of the planes, counted from the first slice; the slice spacing by default.
    reference : path, optional
        Folder of the DICOM series that the surface came from. Patient, study, frame of reference and the
        slices themselves are then referred to; otherwise the object stands alone.

    Raises
    ------
    InputError
        No DICOM images in ``reference``, or the planes miss the mesh.

    Notes
    -----
    Every loop is a ``CLOSED_PLANAR`` contour; holes are determined by nesting (even-odd).
    """
    step = frame.affine[:3, frame.slice_axis]
    normal = step / np.linalg.norm(step)
    spacing = frame.slice_spacing if spacing_mm is None else float(spacing_mm)
    base = frame.affine[:3, 3] @ normal
    level = mesh.vertices @ normal
    first, last = np.floor((level.min() - base) / spacing), np.ceil((level.max() - base) / spacing)
    heights = base + spacing * np.arange(first, last + 1)
    sections = cross_sections(mesh, normal, heights)
    loops = [
        (height, _thinned(loop @ LPS_TO_RAS[:3, :3]))
        for height, section in zip(heights, sections, strict=True)
        for loop in section
    ]
    loops = [(height, loop) for height, loop in loops if len(loop) >= 3]
    if not loops:
        raise InputError(str(path), "no plane meets the surface", "choose a smaller spacing_mm")
    slices = [] if reference is None else _reference_slices(Path(reference))
    dataset = _structure_set(loops, name, slices, normal, spacing)
    with atomic_path(path) as temporary:
        dataset.save_as(temporary, enforce_file_format=True)


def _reference_slices(folder: Path) -> list[Dataset]:
    found = []
    for file in sorted(item for item in folder.rglob("*") if item.is_file()):
        try:
            header = pydicom.dcmread(file, stop_before_pixels=True)
        except (pydicom.errors.InvalidDicomError, OSError):
            continue
        if header.get("ImagePositionPatient"):
            found.append(header)
    if not found:
        raise InputError(
            folder.name, "no DICOM images in this folder", "give the folder of the source series"
        )
    return found


def _item(**attributes) -> Dataset:
    dataset = Dataset()
    for keyword, value in attributes.items():
        setattr(dataset, keyword, value)
    return dataset


def _structure_set(
    loops: list[tuple[float, np.ndarray]],
    name: str,
    slices: list[Dataset],
    normal: np.ndarray,
    spacing: float,
) -> FileDataset:
    """Assemble the RTSTRUCT; UIDs follow from the content, so the same surface gives the same bytes."""
    digest = hashlib.sha256(name.encode())
    for _, loop in loops:
        digest.update(loop.tobytes())
    source = slices[0] if slices else Dataset()
    digest.update(str(source.get("SeriesInstanceUID", "")).encode())
    seed = digest.hexdigest()

    def uid(part: str) -> str:
        return generate_uid(entropy_srcs=[seed, part])

    frame_uid = str(source.get("FrameOfReferenceUID") or uid("frame"))
    meta = FileMetaDataset()
    meta.MediaStorageSOPClassUID = RTStructureSetStorage
    meta.MediaStorageSOPInstanceUID = uid("instance")
    meta.TransferSyntaxUID = ExplicitVRLittleEndian
    dataset = FileDataset(None, {}, file_meta=meta, preamble=b"\0" * 128)
    dataset.SOPClassUID = RTStructureSetStorage
    dataset.SOPInstanceUID = uid("instance")
    dataset.Modality = "RTSTRUCT"
    dataset.SeriesInstanceUID = uid("series")
    dataset.StudyInstanceUID = str(source.get("StudyInstanceUID") or uid("study"))
    if source.get("SpecificCharacterSet"):
        dataset.SpecificCharacterSet = source.SpecificCharacterSet
    for keyword in (
        "PatientName",
        "PatientID",
        "PatientBirthDate",
        "PatientSex",
        "StudyDate",
        "StudyTime",
        "StudyID",
        "AccessionNumber",
        "ReferringPhysicianName",
    ):
        setattr(dataset, keyword, source.get(keyword, ""))
    dataset.SeriesNumber = None
    dataset.Manufacturer = "CCCD"
    dataset.OperatorsName = ""
    dataset.FrameOfReferenceUID = frame_uid
    dataset.PositionReferenceIndicator = ""
    dataset.StructureSetLabel = name[:16]
    dataset.StructureSetDate = dataset.StructureSetTime = ""
    dataset.ApprovalStatus = "UNAPPROVED"
    dataset.ReferencedFrameOfReferenceSequence = Sequence([_item(FrameOfReferenceUID=frame_uid)])
    references = [
        _item(ReferencedSOPClassUID=item.SOPClassUID, ReferencedSOPInstanceUID=item.SOPInstanceUID)
        for item in slices
    ]
    if slices:
        series = _item(SeriesInstanceUID=source.SeriesInstanceUID, ContourImageSequence=Sequence(references))
        study = _item(
            ReferencedSOPClassUID="1.2.840.10008.3.1.2.3.1",
            ReferencedSOPInstanceUID=dataset.StudyInstanceUID,
            RTReferencedSeriesSequence=Sequence([series]),
        )
        dataset.ReferencedFrameOfReferenceSequence[0].RTReferencedStudySequence = Sequence([study])
    roi = _item(
        ROINumber=1, ReferencedFrameOfReferenceUID=frame_uid, ROIName=name, ROIGenerationAlgorithm="AUTOMATIC"
    )
    dataset.StructureSetROISequence = Sequence([roi])
    positions = np.array([[float(x) for x in item.ImagePositionPatient] for item in slices]).reshape(-1, 3)
    levels = positions @ LPS_TO_RAS[:3, :3] @ normal
    contours = []
    for height, loop in loops:
        contour = _item(
            ContourGeometricType="CLOSED_PLANAR",
            NumberOfContourPoints=len(loop),
            ContourData=[f"{x:.3f}" for x in loop.ravel()],
        )
        near = np.flatnonzero(np.abs(levels - height) <= CONTOUR_PLANE * spacing)
        if len(near):
            contour.ContourImageSequence = Sequence([references[near[0]]])
        contours.append(contour)
    dataset.ROIContourSequence = Sequence(
        [_item(ReferencedROINumber=1, ROIDisplayColor=[220, 60, 50], ContourSequence=Sequence(contours))]
    )
    observation = _item(
        ObservationNumber=1, ReferencedROINumber=1, RTROIInterpretedType="ORGAN", ROIInterpreter=""
    )
    dataset.RTROIObservationsSequence = Sequence([observation])
    return dataset
