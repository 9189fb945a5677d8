"""The surface as voxels on its DICOM series (segmentation object, SEG).

That no half file is left is the caller's to see to (`cccd.store.atomic_path`).
"""

from __future__ import annotations

import copy
import hashlib
from pathlib import Path

import highdicom
import numpy as np
from highdicom.seg import Segmentation, SegmentDescription
from highdicom.sr.coding import CodedConcept
from pydicom.dataset import Dataset
from pydicom.uid import generate_uid

from cccd.errors import InputError
from cccd.files import ExportOptions
from cccd.geometry.arrays import ByteArray, FloatArray
from cccd.geometry.raster import voxelise
from cccd.inputs.grid import LPS_TO_RAS
from cccd.inputs.readers import guarded
from cccd.surface.surface import LoftedSurface
from cccd_dicom.rtstruct import copy_identity, reference_slices
from cccd_dicom.slices import CONTOUR_PLANE

#: Said where there is no series, and of headers that highdicom makes no SEG of, such as those of two studies.
_NO_SERIES = ("a SEG needs its DICOM series, and there is none", "name the series' folder as image")
_UNUSABLE = ("its images cannot carry a SEG", "export the series again, or use RTSTRUCT")


def check_series(path: Path, series: Path | None) -> None:
    """Refuse a series that files could not refer to, and a SEG without one."""
    if series is not None:
        reference_slices(series)
    elif path.name.lower().endswith(".seg.dcm"):
        raise InputError(str(path), *_NO_SERIES)


def write(path: Path, surface: LoftedSurface, options: ExportOptions) -> None:
    """Write the voxels whose centres lie inside the mesh as one segment of a SEG.

    The voxels are those of ``options.series``, one image per slice; every image is referred to.

    Raises
    ------
    InputError
        No series, or the mesh holds none of its voxels.
    """
    series, name = options.series, options.organ
    if series is None:
        raise InputError(str(path), *_NO_SERIES)
    with guarded(series.name, *_UNUSABLE):
        slices, affines = _grids(reference_slices(series))
        size = int(slices[0].Columns), int(slices[0].Rows)
    blocks = [voxelise(surface.mesh, LPS_TO_RAS @ affine, (*size, count)) for affine, count in affines]
    mask = np.concatenate(blocks, axis=2)
    if not mask.any():
        raise InputError(str(path), "no voxel of the series lies in the surface", "name the right series")
    frames = np.ascontiguousarray(mask.transpose(2, 1, 0), np.uint8)
    step = float(np.linalg.norm(affines[0][0][:3, 2]))
    sources = [_source(image, step, options.settings.keep_patient) for image in slices]
    with guarded(series.name, *_UNUSABLE):
        dataset = _segmentation(frames, name, sources)
    dataset.save_as(path, enforce_file_format=True)


def _grids(slices: list[Dataset]) -> tuple[list[Dataset], list[tuple[FloatArray, int]]]:
    """Sort slices along their normal; with them the grids that they lie on, and how many lie on each."""
    # A grid is an affine (4, 4) from (column, row, slice) to mm LPS. Even slices, tilted ones too, have one;
    # of uneven ones each has its own.
    along, down = np.reshape([float(x) for x in slices[0].ImageOrientationPatient], (2, 3))
    positions = np.array([[float(x) for x in image.ImagePositionPatient] for image in slices])
    order = np.argsort(positions @ np.cross(along, down), kind="stable")
    positions = positions[order]
    step = (positions[-1] - positions[0]) / max(len(slices) - 1, 1)
    if not step.any():
        step = np.cross(along, down)
    even = positions[0] + np.arange(len(slices))[:, None] * step
    away = np.linalg.norm(positions - even, axis=1).max()
    rows, columns = (float(size) for size in slices[0].PixelSpacing)
    affine = np.eye(4)
    affine[:3, :3] = np.column_stack([along * columns, down * rows, step])
    uneven = away > CONTOUR_PLANE * np.linalg.norm(step)
    affines: list[tuple[FloatArray, int]] = []
    for position in positions if uneven else positions[:1]:
        affine[:3, 3] = position
        affines.append((affine.copy(), 1 if uneven else len(slices)))
    return [slices[n] for n in order], affines


def _source(image: Dataset, step: float, keep_patient: bool) -> Dataset:
    """Copy an image's header: as thick as the step where it is silent, nobody's unless that is kept."""
    copied = copy.deepcopy(image)
    copied.SliceThickness = image.get("SliceThickness") or step
    copy_identity(image if keep_patient else Dataset(), copied)
    return copied


def _segmentation(frames: ByteArray, name: str, slices: list[Dataset]) -> Segmentation:
    """Make a SEG of frames (S, rows, columns); its UIDs follow from the content."""
    seed = hashlib.sha256(frames.tobytes() + name.encode() + slices[0].SeriesInstanceUID.encode()).hexdigest()
    segment = SegmentDescription(
        segment_number=1,
        segment_label=name,
        segmented_property_category=CodedConcept("123037004", "SCT", "Anatomical Structure"),
        segmented_property_type=CodedConcept("113343008", "SCT", "Organ"),
        algorithm_type="AUTOMATIC",
        algorithm_identification=highdicom.AlgorithmIdentificationSequence(
            name="CCCD",
            version="1",
            family=CodedConcept("123110", "DCM", "Artificial Intelligence"),
        ),
    )
    return Segmentation(
        source_images=slices,
        pixel_array=frames,
        segmentation_type="BINARY",
        segment_descriptions=[segment],
        series_instance_uid=generate_uid(entropy_srcs=[seed, "series"]),
        series_number=1,
        sop_instance_uid=generate_uid(entropy_srcs=[seed, "instance"]),
        instance_number=1,
        manufacturer="CCCD",
        manufacturer_model_name="CCCD",
        software_versions="CCCD",
        device_serial_number="0",
        content_label="SEGMENTATION",
    )
