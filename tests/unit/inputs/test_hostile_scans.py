"""Scans that ask for too much, and scans that say whose they are."""

import numpy as np
import pydicom
import pytest
from support import scans
from support.refusals import refusal

from cccd import store
from cccd.geometry.mesh import Mesh
from cccd.inputs.readers import MOST, read_volume
from cccd_dicom.readers import Regions, Segments, read_series
from cccd_dicom.rtstruct import write_rtstruct
from cccd_viewers.viewer import case_figure
from cccd_workflow.report.page import build_case_page

MASK = scans.organ()  # 44 x 38 x 14 voxels
TETRAHEDRON = Mesh(np.eye(4, 3, -1), np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]))
MARK = "Zaphod"
TEMPLATES = scans.ROOT / "workflow" / "report"
WHO = f"<img src=x onerror=steal()>^{MARK}"
#: What PS3.15, annex E, has removed of these, and free text in which people write names.
IDENTITY = (
    *("PatientName", "PatientID", "OtherPatientNames", "PatientAddress", "PatientComments", "StudyID"),
    *("StudyDescription", "SeriesDescription", "InstitutionName", "ReferringPhysicianName", "OperatorsName"),
    *("AccessionNumber", "RequestingPhysician", "ProtocolName", "ImageComments"),
)


def identified_series(folder):
    """A series with its organ as SEG and RTSTRUCT, in each of which every such attribute names somebody."""
    affine = scans.dicom_affine()
    series = scans.write_series(folder / "scan", scans.grey(MASK), affine)
    scans.write_seg(folder / "seg.dcm", {"organ": MASK}, series, ["organ"])
    scans.write_structure_set(folder / "rt.dcm", {"organ": scans.outlines(MASK, affine)})
    for path in [*folder.rglob("*.dcm")]:
        dataset = pydicom.dcmread(path)
        for keyword in IDENTITY:
            setattr(dataset, keyword, WHO if keyword.endswith(("Name", "Names")) else MARK)
        dataset.save_as(path)


@pytest.mark.parametrize("mask", ["seg.dcm", "rt.dcm"])
def test_who_the_patient_is_stays_in_the_scan(tmp_path, mask):
    identified_series(tmp_path)
    structure = scans.load(tmp_path, image="scan", mask=mask)
    store.write_structure(tmp_path / "structure.h5", structure)
    assert MARK.encode() not in (tmp_path / "structure.h5").read_bytes()
    assert MARK not in str(structure.provenance) + str(structure.warnings)


def test_nor_does_a_message_say_it(tmp_path):
    identified_series(tmp_path)
    scans.write_series(tmp_path / "scan" / "again", scans.grey(MASK), scans.dicom_affine(), uid=MARK)
    line = refusal(scans.load, tmp_path, image="scan")
    assert "2 DICOM series" in line
    assert MARK not in line


@pytest.mark.parametrize("keep", [False, True])
def test_the_structure_set_says_it_when_asked(tmp_path, keep):
    identified_series(tmp_path)
    frame = scans.load(tmp_path, image="scan", mask="seg.dcm").frame
    corners = 10 * TETRAHEDRON.vertices + frame.affine[:3, :3] @ [20, 20, 5] + frame.affine[:3, 3]
    mesh = Mesh(corners, TETRAHEDRON.faces)
    path = tmp_path / "out.dcm"
    write_rtstruct(path, mesh, frame, name="x", reference=tmp_path / "scan", keep_patient=keep)
    written = pydicom.dcmread(path)
    assert (MARK.encode() in path.read_bytes()) == keep
    assert (str(written.PatientName) == WHO) == keep
    # it belongs to the scan either way
    first = pydicom.dcmread(next((tmp_path / "scan").glob("*.dcm")))
    assert written.StudyInstanceUID == first.StudyInstanceUID
    assert written.FrameOfReferenceUID == first.FrameOfReferenceUID


def test_names_of_labels_are_text_on_a_page(tmp_path):
    told = {"organ": "a", "name": WHO + "</script><script>steal()", "color": "#ffffff", "volume_ml": 1.0}
    scene = {"case": "<b>case</b>", "organs": [told]}
    build_case_page(scene, {"a": TETRAHEDRON}, TEMPLATES, tmp_path / "page.html")
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    (shown,) = case_figure([told], {"a": TETRAHEDRON})["data"]
    assert "&lt;img" in shown["name"]
    assert "<" not in shown["name"]
    assert "<img src=x" not in page
    assert "<script>steal" not in page
    assert "<b>case" not in page


def asks(folder, kind):
    """Write the organ in one way, and give the columns that name it."""
    affine = scans.dicom_affine()
    if kind == "nifti":
        scans.write_nifti(folder / "m.nii.gz", MASK.astype(np.uint8), affine)
    elif kind == "nrrd":
        scans.write_itk(folder / "m.nrrd", MASK.astype(np.uint8), affine)
    elif kind == "rtstruct":
        scans.write_structure_set(folder / "m.dcm", {"organ": scans.outlines(MASK, affine)})
    else:
        series = scans.write_series(folder / "scan", scans.grey(MASK), affine)
        scans.write_seg(folder / "m.dcm", {"organ": MASK}, series, ["organ"])
    names = {"nifti": "m.nii.gz", "nrrd": "m.nrrd"}
    return {"image": "scan" if kind == "series" else "", "mask": names.get(kind, "m.dcm")}


@pytest.mark.parametrize(
    ("kind", "limit", "most"),
    [
        ("nifti", "slices", 14),
        ("nifti", "pixels", 44 * 38),
        ("nrrd", "voxels", MASK.size),
        ("series", "slices", 14),
        ("series", "pixels", 44 * 38),
        ("seg", "voxels", 44 * 38),
        ("rtstruct", "contours", 3),
        ("rtstruct", "contour_points", 20),
    ],
)
def test_what_a_file_may_ask_for(monkeypatch, tmp_path, kind, limit, most):
    columns = asks(tmp_path, kind)
    scans.load(tmp_path, **columns)
    path = tmp_path / (columns["image"] or columns["mask"])
    monkeypatch.setitem(MOST, limit, most - 1)
    read = {
        "series": lambda: read_series(path),
        "seg": lambda: Segments.read(path).mask("", "organ", None),
        "rtstruct": lambda: Regions.read(path).contours("", "organ"),
    }.get(kind, lambda: read_volume(path))
    assert f"and {most - 1} are allowed; mend its header, or give a part" in refusal(read)
