"""The surface as a mesh within DICOM (encapsulated STL, M3D), in LPS as DICOM demands.

That no half file is left is the caller's to see to (`cccd.store.atomic_path`).
"""

from __future__ import annotations

import hashlib
from pathlib import Path

from pydicom.dataset import Dataset
from pydicom.sequence import Sequence
from pydicom.uid import UID

from cccd.files import ExportOptions, binary_stl
from cccd.inputs.grid import LPS_TO_RAS
from cccd.surface.surface import LoftedSurface
from cccd_dicom.rtstruct import copy_identity, identified_dataset, item_of, reference_slices, references_to

#: Encapsulated STL Storage (PS3.4, annex B.5).
_SOP_CLASS = UID("1.2.840.10008.5.1.4.1.1.104.3")


def write(path: Path, surface: LoftedSurface, options: ExportOptions) -> None:
    """Write the mesh in mm LPS as encapsulated STL (PS3.3, A.85.1).

    With ``options.series`` study, frame of reference and slices are referred to by their UIDs.

    Raises
    ------
    InputError
        No DICOM images in the series.

    Notes
    -----
    UIDs follow from the content, so that equal surfaces have equal bytes; dates are left empty.
    """
    slices = [] if options.series is None else reference_slices(options.series)
    source = slices[0] if slices else Dataset()
    stl = binary_stl(surface.mesh.transformed(LPS_TO_RAS), f"{options.organ}; unit mm; SPACE=LPS")
    seed = hashlib.sha256(stl + str(source.get("SeriesInstanceUID", "")).encode()).hexdigest()
    dataset = identified_dataset(_SOP_CLASS, "M3D", source, seed)
    dataset.SeriesNumber = dataset.InstanceNumber = 1
    dataset.ManufacturerModelName = dataset.SoftwareVersions = "CCCD"
    dataset.DeviceSerialNumber = "0"
    dataset.ContentDate = dataset.ContentTime = dataset.AcquisitionDateTime = ""
    dataset.BurnedInAnnotation = "NO"
    dataset.DocumentTitle = options.organ
    dataset.ConceptNameCodeSequence = Sequence([_code("85040-4", "LN", "Segmented anatomy model")])
    dataset.MIMETypeOfEncapsulatedDocument = "model/stl"
    dataset.EncapsulatedDocumentLength = len(stl)
    dataset.EncapsulatedDocument = stl + b"\0" * (len(stl) % 2)
    dataset.MeasurementUnitsCodeSequence = Sequence([_code("mm", "UCUM", "mm")])
    dataset.ModelModification = dataset.ModelMirroring = "NO"
    if slices:
        _refer_to(slices, dataset)
        if options.settings.keep_patient:
            copy_identity(source, dataset)
    dataset.save_as(path, enforce_file_format=True)


def _code(value: str, scheme: str, meaning: str) -> Dataset:
    """Make a coded concept."""
    return item_of(CodeValue=value, CodingSchemeDesignator=scheme, CodeMeaning=meaning)


def _refer_to(slices: list[Dataset], dataset: Dataset) -> None:
    """Name the images that a model was made from."""
    dataset.SourceInstanceSequence = Sequence(references_to(slices))
    images = Sequence(references_to(slices))
    series = item_of(SeriesInstanceUID=slices[0].SeriesInstanceUID, ReferencedInstanceSequence=images)
    dataset.ReferencedSeriesSequence = Sequence([series])
