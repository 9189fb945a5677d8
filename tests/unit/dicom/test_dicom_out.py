"""What goes out as DICOM, read by programs of others: dciodvfy (Debian's dicom3tools), trimesh, Orthanc."""

import io
import json
import os
import shutil
import socket
import subprocess
import time
import urllib.request
from functools import partial

import numpy as np
import pydicom
import pytest
import trimesh
from support import scans

import cccd
from cccd.containers import Frame
from cccd.errors import InputError
from cccd.geometry.mesh import Mesh
from cccd.geometry.raster import voxelise
from cccd_dicom.encapsulated_stl import write_encapsulated_stl
from cccd_dicom.rtstruct import write_rtstruct
from cccd_dicom.seg import write_seg

AFFINE = scans.dicom_affine()
KINDS = ("RTSTRUCT", "M3D", "SEG")
CENTRE = (AFFINE @ (18, 18, 6, 1))[:3]


@pytest.fixture
def series(tmp_path):
    """A series of the organ, in the folder ``dicom``."""
    return scans.write_series(tmp_path / "dicom", scans.grey(scans.organ()), AFFINE)


def ball():
    mesh = trimesh.creation.icosphere(3, 12.0)
    return Mesh(mesh.vertices + CENTRE, np.asarray(mesh.faces, np.int64))


def errors_of(path):
    if shutil.which("dciodvfy") is None:
        pytest.skip("dciodvfy is not installed (Debian's dicom3tools)")
    told = subprocess.run(["dciodvfy", path], capture_output=True, text=True)
    return [line for line in (told.stdout + told.stderr).splitlines() if line.startswith("Error")]


def write_kind(kind, path, folder):
    """Write the ball as RTSTRUCT, M3D or SEG that refers to the series of a folder, or to none."""
    if kind == "SEG":
        write_seg(path, ball(), name="liver", reference=folder, keep_patient=True)
    elif kind == "M3D":
        write_encapsulated_stl(path, ball(), name="liver", reference=folder, keep_patient=True)
    else:
        frame = Frame(AFFINE, 2, scans.organ().shape)
        write_rtstruct(path, ball(), frame, name="liver", reference=folder, keep_patient=True)


def edit_headers(folder, change):
    """Change every slice of a folder in place; what the standard demands may go."""
    for file in folder.iterdir():
        dataset = pydicom.dcmread(file)
        change(dataset)
        pydicom.dcmwrite(file, dataset, enforce_file_format=False)


COMMON = ("StudyInstanceUID", "SeriesInstanceUID", "FrameOfReferenceUID")


def strip(dataset, blank=False):
    """Leave what identifies an image to its file's header, and what identifies its series to nobody."""
    for keyword in ("SOPClassUID", "SOPInstanceUID", "SliceThickness", *COMMON):
        if blank:
            dataset[keyword].value = None
        else:
            del dataset[keyword]


@pytest.mark.parametrize("blank", [True, False], ids=["blank", "absent"])
@pytest.mark.parametrize("kind", KINDS)
def test_what_only_the_header_says_of_an_image_is_referred_to(tmp_path, kind, blank, caplog, series):
    edit_headers(tmp_path / "dicom", partial(strip, blank=blank))
    write_kind(kind, tmp_path / "out.dcm", tmp_path / "dicom")
    written = pydicom.dcmread(tmp_path / "out.dcm")
    assert scans.empty_uids(written) == []
    assert scans.referred(written) == {(image.SOPClassUID, image.SOPInstanceUID) for image in series}
    write_kind("RTSTRUCT", tmp_path / "other.dcm", tmp_path / "dicom")
    other = pydicom.dcmread(tmp_path / "other.dcm")
    assert written.StudyInstanceUID == other.StudyInstanceUID
    assert written.FrameOfReferenceUID == other.FrameOfReferenceUID
    assert caplog.text.count("its images have no StudyInstanceUID") == 1


@pytest.mark.parametrize("slices", ["whole", "bare", "none"])
@pytest.mark.parametrize("kind", KINDS)
def test_dciodvfy_finds_no_error(tmp_path, kind, slices, series):
    if kind == "SEG" and slices == "none":
        pytest.skip("a SEG lies on a series")
    if slices == "bare":
        edit_headers(tmp_path / "dicom", strip)
    write_kind(kind, tmp_path / "out.dcm", None if slices == "none" else tmp_path / "dicom")
    written = pydicom.dcmread(tmp_path / "out.dcm")
    assert written.Modality == kind
    if slices == "whole":
        assert written.StudyInstanceUID == series[0].StudyInstanceUID
    assert errors_of(tmp_path / "out.dcm") == []


def test_a_seg_of_slices_that_only_the_header_tells_apart_is_read_back(tmp_path, series):
    edit_headers(tmp_path / "dicom", lambda dataset: dataset.__delitem__("SOPInstanceUID"))
    write_kind("SEG", tmp_path / "seg.dcm", tmp_path / "dicom")
    read = scans.load(tmp_path, image="dicom", mask="seg.dcm")
    np.testing.assert_array_equal(scans.full(read), voxelise(ball(), read.frame.affine, read.frame.shape))


@pytest.mark.parametrize("keyword", ["SOPClassUID", "SOPInstanceUID"])
@pytest.mark.parametrize("kind", KINDS)
def test_an_image_that_nothing_can_refer_to_is_named(tmp_path, kind, keyword, series):

    def silence(dataset):
        del dataset[keyword]
        del dataset.file_meta[f"MediaStorage{keyword}"]

    edit_headers(tmp_path / "dicom", silence)
    with pytest.raises(InputError, match=rf"000\.dcm: it has no {keyword}; export the series again"):
        write_kind(kind, tmp_path / "out.dcm", tmp_path / "dicom")
    assert not (tmp_path / "out.dcm").exists()


@pytest.mark.parametrize("kind", KINDS)
def test_images_of_one_name_are_refused(tmp_path, kind, series):
    edit_headers(tmp_path / "dicom", lambda dataset: setattr(dataset, "SOPInstanceUID", "1.2.3"))
    with pytest.raises(
        InputError, match=r"dicom: \d+ of its images have one SOPInstanceUID, 1\.2\.3; export"
    ):
        write_kind(kind, tmp_path / "out.dcm", tmp_path / "dicom")


@pytest.mark.filterwarnings("ignore:Invalid value for VR UI")
@pytest.mark.parametrize("kind", KINDS)
def test_a_word_in_the_place_of_a_uid_is_none(tmp_path, kind, series):

    def write_words(dataset):
        for keyword in ("SOPInstanceUID", *COMMON):
            setattr(dataset, keyword, "anonymised")

    edit_headers(tmp_path / "dicom", write_words)
    write_kind(kind, tmp_path / "out.dcm", tmp_path / "dicom")
    written = pydicom.dcmread(tmp_path / "out.dcm")
    uids = [element.value for element in written.iterall() if element.VR == "UI"]
    assert "anonymised" not in uids
    assert scans.referred(written) == {(image.SOPClassUID, image.SOPInstanceUID) for image in series}


def test_a_dose_beside_the_images_is_none_of_them(tmp_path, series):
    dose = series[0]
    dose.Modality, dose.SOPInstanceUID = "RTDOSE", "1.2.3"
    dose.save_as(tmp_path / "dicom" / "dose.dcm")
    write_kind("RTSTRUCT", tmp_path / "out.dcm", tmp_path / "dicom")
    assert "1.2.3" not in {instance for _, instance in scans.referred(pydicom.dcmread(tmp_path / "out.dcm"))}


@pytest.mark.parametrize("where", ["below", "of no modality"])
def test_a_series_that_was_read_is_referred_to(tmp_path, where):
    series = scans.write_series(tmp_path / "scan" / "study", scans.grey(scans.organ()), AFFINE)
    folder = tmp_path / "scan"
    if where == "of no modality":
        folder = folder / "study"
        edit_headers(folder, lambda dataset: dataset.__delitem__("Modality"))
    scans.write_nifti(tmp_path / "mask.nii", scans.organ().astype(np.uint8), AFFINE)
    surface = cccd.reconstruct(cccd.read(tmp_path / "mask.nii", image=folder))
    written = pydicom.dcmread(surface.write(tmp_path / "out.dcm"))
    assert scans.referred(written) == {(image.SOPClassUID, image.SOPInstanceUID) for image in series}


@pytest.mark.parametrize("keyword", COMMON)
def test_a_seg_on_slices_of_two_kinds_is_refused_in_one_line(tmp_path, keyword, series):
    uids = iter(range(1, 100))
    edit_headers(tmp_path / "dicom", lambda dataset: setattr(dataset, keyword, f"1.2.{next(uids)}"))
    with pytest.raises(InputError, match=r"dicom: its images cannot carry a SEG .*; export the series again"):
        write_kind("SEG", tmp_path / "out.dcm", tmp_path / "dicom")


@pytest.fixture
def archive(tmp_path):
    """The address of an Orthanc that runs during the test, on a port of its own and with an empty store."""
    program = shutil.which("Orthanc", path=f"{os.environ['PATH']}:/usr/sbin")
    if program is None:
        pytest.skip("Orthanc is not installed (Debian's orthanc)")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    store = str(tmp_path / "store")
    options = {"StorageDirectory": store, "IndexDirectory": store, "HttpPort": port, "Plugins": []}
    options |= {"DicomServerEnabled": False, "RemoteAccessAllowed": False, "AuthenticationEnabled": False}
    (tmp_path / "orthanc.json").write_text(json.dumps(options))
    with (tmp_path / "orthanc.log").open("w") as log:
        process = subprocess.Popen([program, tmp_path / "orthanc.json"], stdout=log, stderr=log)
    address = f"http://127.0.0.1:{port}"
    try:
        for _ in range(300):
            try:
                ask(f"{address}/system")
                break
            except OSError:
                assert process.poll() is None, (tmp_path / "orthanc.log").read_text()
                time.sleep(0.1)
        yield address
    finally:
        process.terminate()
        process.wait(30)


def ask(address, content=None):
    """What a server answers to a GET, or to a POST of some bytes."""
    with urllib.request.urlopen(urllib.request.Request(address, content), timeout=30) as answer:
        return answer.read()


def test_an_archive_keeps_all_kinds_with_their_scan(archive, tmp_path, series):
    files = sorted((tmp_path / "dicom").iterdir())
    for kind in KINDS:
        files.append(tmp_path / f"{kind}.dcm")
        write_kind(kind, files[-1], tmp_path / "dicom")
    for file in files:
        stored = json.loads(ask(f"{archive}/instances", file.read_bytes()))
        assert stored["Status"] == "Success"
        assert ask(f"{archive}/instances/{stored['ID']}/file") == file.read_bytes()
    (study,) = json.loads(ask(f"{archive}/studies?expand"))
    series = [json.loads(ask(f"{archive}/series/{name}")) for name in study["Series"]]
    kinds = sorted(one["MainDicomTags"]["Modality"] for one in series)
    assert kinds == ["CT", "M3D", "RTSTRUCT", "SEG"]


def test_an_encapsulated_stl_is_the_mesh_in_lps_and_refers_to_every_slice(tmp_path, series):
    mesh = ball()
    write_encapsulated_stl(tmp_path / "a.dcm", mesh, name="liver", reference=tmp_path / "dicom")
    write_encapsulated_stl(tmp_path / "b.dcm", mesh, name="liver", reference=tmp_path / "dicom")
    assert (tmp_path / "a.dcm").read_bytes() == (tmp_path / "b.dcm").read_bytes()
    held = pydicom.dcmread(tmp_path / "a.dcm")
    stl = held.EncapsulatedDocument[: held.EncapsulatedDocumentLength]
    back = trimesh.load(io.BytesIO(stl), file_type="stl")
    assert back.is_watertight
    np.testing.assert_allclose(back.bounds.mean(axis=0), CENTRE * (-1, -1, 1), atol=1e-3)
    assert back.volume == pytest.approx(mesh.volume, rel=1e-4)
    assert {part.ReferencedSOPInstanceUID for part in held.SourceInstanceSequence} == {
        image.SOPInstanceUID for image in series
    }
    assert held.FrameOfReferenceUID == series[0].FrameOfReferenceUID
    assert held.PatientName == ""


@pytest.mark.parametrize("turn", [(0, 0, 0), (15, -20, 30)], ids=["straight", "oblique"])
def test_a_seg_has_the_voxels_inside_on_every_slice_of_its_series(tmp_path, turn):
    affine = scans.affine_of(turn=turn) @ np.diag([-1.0, -1.0, 1.0, 1.0])
    mesh = ball()
    mesh = Mesh(mesh.vertices - CENTRE + (affine @ (18, 18, 6, 1))[:3], mesh.faces)
    series = scans.write_series(tmp_path / "dicom", scans.grey(scans.organ()), affine)
    write_seg(tmp_path / "seg.dcm", mesh, name="liver", reference=tmp_path / "dicom")
    read = scans.load(tmp_path, image="dicom", mask="seg.dcm", label="liver")
    np.testing.assert_array_equal(scans.full(read), voxelise(mesh, read.frame.affine, read.frame.shape))
    held = pydicom.dcmread(tmp_path / "seg.dcm")
    images = held.ReferencedSeriesSequence[0].ReferencedInstanceSequence
    assert {part.ReferencedSOPInstanceUID for part in images} <= {image.SOPInstanceUID for image in series}
    assert held.PatientName == ""


def test_a_seg_without_a_series_is_refused_in_one_line(tmp_path):
    with pytest.raises(InputError, match="needs its DICOM series"):
        write_seg(tmp_path / "seg.dcm", ball(), name="liver", reference=None)


def test_a_seg_of_another_patients_series_is_refused(tmp_path, series):
    far = Mesh(ball().vertices + 500, ball().faces)
    with pytest.raises(InputError, match="no voxel of the series"):
        write_seg(tmp_path / "seg.dcm", far, name="liver", reference=tmp_path / "dicom")


def test_a_seg_on_slices_with_a_gap_has_the_frames_of_the_others(tmp_path):
    scans.write_series(tmp_path / "whole", scans.grey(scans.organ()), AFFINE)
    scans.write_series(tmp_path / "gap", scans.grey(scans.organ()), AFFINE, skip=(5,))
    frames = {}
    for name in ("whole", "gap"):
        write_seg(tmp_path / f"{name}.dcm", ball(), name="liver", reference=tmp_path / name)
        dataset = pydicom.dcmread(tmp_path / f"{name}.dcm")
        places = [
            frame.PlanePositionSequence[0].ImagePositionPatient[2]
            for frame in dataset.PerFrameFunctionalGroupsSequence
        ]
        frames[name] = dict(zip(map(float, places), dataset.pixel_array, strict=True))
    assert set(frames["gap"]) < set(frames["whole"])
    for place, frame in frames["gap"].items():
        np.testing.assert_array_equal(frame, frames["whole"][place])
