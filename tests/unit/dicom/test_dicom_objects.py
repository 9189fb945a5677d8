"""What tells drawn contours from masks before any scan is opened."""

from pathlib import Path

import numpy as np
import pydicom
import pytest
from pydicom.uid import RTStructureSetStorage
from support import fresh, scans
from support.refusals import refusal

from cccd.file_headers import dicom_modality, object_in
from cccd_dicom.references import lies_in_its_series
from cccd_workflow.plan.cohort import holds_contours


def write(path: Path, modality: str, **uids: str) -> Path:
    file = scans.dicom_file(RTStructureSetStorage, [path.name])
    file.Modality = modality
    file.update(uids)
    file.save_as(path, enforce_file_format=True)
    return path


@pytest.mark.parametrize("name", ["rt.dcm", "RS1.2.840", "contours"])
def test_an_rtstruct_is_known_by_its_content_whatever_its_name(tmp_path, name):
    assert holds_contours(write(tmp_path / name, "RTSTRUCT"))
    assert dicom_modality(tmp_path / name) == "RTSTRUCT"


def test_what_holds_no_contours(tmp_path):
    (tmp_path / "mask.nii.gz").write_bytes(b"\x1f\x8b" + bytes(300))
    (tmp_path / "short").write_bytes(b"DICM")
    torn = write(tmp_path / "torn.dcm", "RTSTRUCT")
    torn.write_bytes(torn.read_bytes()[:140])
    write(tmp_path / "seg.dcm", "SEG")
    names = ["mask.nii.gz", "short", "torn.dcm", "not_there.dcm", ".", "seg.dcm"]
    assert [name for name in names if holds_contours(tmp_path / name)] == []
    assert dicom_modality(tmp_path / "mask.nii.gz") is None
    assert dicom_modality(torn) == ""


def test_a_folder_with_one_object_stands_for_it(tmp_path):
    write(tmp_path / "image.dcm", "CT")
    assert object_in(tmp_path) == tmp_path
    contours = write(tmp_path / "contours.dcm", "RTSTRUCT")
    assert object_in(tmp_path) == contours
    assert holds_contours(tmp_path)
    write(tmp_path / "seg.dcm", "SEG")
    assert "2 SEG or RTSTRUCT objects" in refusal(object_in, tmp_path)
    assert not holds_contours(tmp_path)  # the job that imports it says why


def test_each_file_beside_an_object_is_read_once(tmp_path, monkeypatch):
    for name, modality, frame in (("rt", "RTSTRUCT", "1.2"), ("ct", "CT", "1.3"), ("mr", "MR", "1.2")):
        write(tmp_path / name, modality, FrameOfReferenceUID=frame, SeriesInstanceUID="")
    opened, read = [], pydicom.dcmread
    monkeypatch.setattr(pydicom, "dcmread", lambda path, **how: opened.append(path.name) or read(path, **how))
    assert lies_in_its_series(tmp_path / "rt")
    assert max(opened.count(name) for name in ("ct", "mr")) == 1


def test_a_scan_is_not_opened_beyond_its_first_bytes_nor_pydicom_imported_for_it(tmp_path):
    np.zeros(100).tofile(tmp_path / "mask.nii")
    code = (
        "import sys; from pathlib import Path; from cccd_workflow.plan.cohort import holds_contours\n"
        "assert not holds_contours(Path(sys.argv[1])); assert 'pydicom' not in sys.modules"
    )
    fresh.python(code, tmp_path / "mask.nii")
