"""Whatever is wrong with a scan, the user gets one line that names the row, the problem and a hint."""

import gzip
import re
import shutil

import nibabel
import numpy as np
import pydicom
import pytest
from hypothesis import HealthCheck, given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from support import scans
from support.refusals import refusal

import cccd
from cccd.errors import InputError
from cccd.inputs.labels import choose_labels
from cccd.inputs.load import existing
from cccd.inputs.readers import read_volume

MASK = scans.organ().astype(np.uint8)


def circle(z, radius=10.0, centre=(0.0, 0.0)):
    angles = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    x, y = centre[0] + radius * np.cos(angles), centre[1] + radius * np.sin(angles)
    return np.column_stack([x, y, np.full(40, float(z))])


def refused(folder, *parts, columns=None, **changes):
    message = refusal(scans.load, folder, changes, **columns or {"mask": "mask.nii"})
    assert message.startswith("cohort.tsv row 2: ")
    assert "; " in message
    for part in parts:
        assert part in message
    return message


def nifti(values, affine=None, name="mask.nii"):
    """Writes a volume of these values."""
    return lambda folder: scans.write_nifti(
        folder / name, values, scans.affine_of() if affine is None else affine
    )


def content(name, data):
    """Writes a file of these bytes."""

    def write(folder):
        (folder / name).write_bytes(data)
        return folder / name

    return write


def cut(name, keep):
    """Writes the first bytes of a whole volume: so many, or a share."""

    def write(folder):
        whole = scans.write_nifti(folder / f"full.{name}", MASK, scans.affine_of()).read_bytes()
        return content(name, whole[: keep if keep > 1 else int(keep * len(whole))])(folder)

    return write


def a_picture(folder):
    import matplotlib.image

    matplotlib.image.imsave(folder / "mask.png", np.random.default_rng(0).random((9, 9, 3)))
    return folder / "mask.png"


def zero_spacing(folder):
    scans.write_nifti(folder / "mask.nii", MASK, scans.affine_of())
    header = bytearray((folder / "mask.nii").read_bytes())
    for line in range(3):  # third column of the sform
        header[280 + 16 * line + 8 : 280 + 16 * line + 12] = bytes(4)
    return content("mask.nii", header)(folder)


def a_folder_without_masks(folder):
    (folder / "mask").mkdir()
    (folder / "mask" / "readme.txt").write_text("nothing")
    return folder / "mask"


def another_name(folder):
    nifti(MASK, name="msak.nii")(folder)
    return folder / "mask.nii"


def no_folder(folder):
    folder.rmdir()
    return folder / "mask.nii"


def changed(array, at, value):
    array = array.astype(float)
    array[at] = value
    return array


PERCENT = MASK * np.linspace(1, 99.5, 14).astype(np.float32)
SHEAR = np.array([[0, 0.5, 0, 0], [0, 0, 1.0, 0], [0.5, 0, 0, 0], [0, 0, 0, 0]])
COLOURS = np.zeros(MASK.shape, [("R", "u1"), ("G", "u1"), ("B", "u1")])
HOLE = changed(MASK, (3, 3, 3), np.nan).astype(np.float32)
SCAN = scans.grey(MASK > 0).astype(np.float32) + np.float32(0.25)
TEXT = b"this is not a scan"
#: What is written for the row to name, and what the line says.
VOLUMES = {
    "percent": (nifti(PERCENT), ["0 to ", "are neither labels nor probabilities", "from 0 to 1"]),
    "in micrometres": (
        nifti(MASK, scans.affine_of(spacing=(1500.0, 1200.0, 4000.0))),
        ["voxels 1500 x 1200 x 4000 mm", "give millimetres in the header"],
    ),
    "a surface": (
        content("mask.stl", b"solid a\nendsolid a\n"),
        ["a surface, not a volume", "give the mask from which it was made"],
    ),
    "a table": (content("mask.tsv", b"case\torgan\tmask\n"), ["a table, not a volume", "cohort sheet"]),
    "properties of a scan": (content("mask.pkl", b""), ["give the .npz next to it"]),
    "nothing there": (another_name, ["there is no mask.nii", "did you mean 'msak.nii'?"]),
    "no folder": (no_folder, ["nor its folder"]),
    "truncated gz": (cut("mask.nii.gz", 0.5), ["damaged or truncated"]),
    "truncated": (cut("mask.nii", 5000), ["mask.nii: "]),
    "text called nii": (content("mask.nii", TEXT), ["not a readable NIfTI"]),
    "text called gz": (content("mask.nii.gz", TEXT), ["mask.nii.gz: "]),
    "empty file": (content("mask.nii", b""), ["mask.nii: "]),
    "not an image": (content("mask.nrrd", b"NRRD0004\ntype: banana\n"), ["not a readable volume"]),
    "a picture": (a_picture, ["colour"]),
    "a spreadsheet": (content("mask.xlsx", b"PK\x03\x04 " + TEXT), ["not a readable volume"]),
    "four dimensions": (nifti(np.stack([MASK, MASK], axis=-1)), ["not a 3-D volume (44 x 38 x 14 x 2)"]),
    "two dimensions": (nifti(MASK[:, :, 5]), ["not a 3-D volume (44 x 38)"]),
    "colours": (nifti(COLOURS), ["colour"]),
    "zero spacing": (zero_spacing, ["no extent (1.5 x 1.2 x 0 mm)"]),
    "an affine that is not finite": (
        nifti(MASK, changed(scans.affine_of(), (0, 3), np.nan)),
        ["affine is not finite"],
    ),
    "sheared": (nifti(MASK, scans.affine_of() + SHEAR), ["at right angles"]),
    "empty mask": (nifti(MASK * 0), ["the mask is empty"]),
    "a mask that is not finite": (nifti(HOLE), ["not finite"]),
    "a scan as mask": (nifti(SCAN), ["neither labels nor probabilities"]),
    "negative only": (
        nifti(-MASK.astype(np.int16)),
        ["the mask is empty but for negative values (down to -1)"],
    ),
    "a folder without masks": (a_folder_without_masks, ["no masks in this folder"]),
}


@pytest.mark.parametrize(("make", "parts"), VOLUMES.values(), ids=VOLUMES)
def test_bad_mask(tmp_path, make, parts):
    folder = tmp_path / "scans"
    folder.mkdir()
    refused(folder, *parts, columns={"mask": make(folder).name})


def test_absent_label_lists_those_present(tmp_path):
    scans.write_nifti(tmp_path / "mask.nii", MASK * 5 + (np.arange(14) == 6) * MASK, scans.affine_of())
    refused(tmp_path, "no label '7'", "choose one of 5, 6", columns={"mask": "mask.nii", "label": "7"})
    refused(tmp_path, "no label '7'", columns={"mask": "mask.nii", "label": "5,7"})
    refused(tmp_path, "no label 'liver'", columns={"mask": "mask.nii", "label": "liver"})


def test_a_label_of_probabilities_is_refused(tmp_path):
    scans.write_nifti(tmp_path / "mask.nii", MASK * np.float32(0.75), scans.affine_of())
    refused(tmp_path, "not labels; leave the label out", columns={"mask": "mask.nii", "label": "1"})


def test_an_organ_in_metres_is_warned_of(tmp_path):
    scans.write_nifti(tmp_path / "mask.nii", MASK, scans.affine_of(spacing=(0.0015, 0.0012, 0.004)))
    structure = scans.load(tmp_path, mask="mask.nii")
    assert any("are the header's units millimetres?" in warning for warning in structure.warnings)


@pytest.mark.parametrize(
    "change",
    [
        {"shape": (40, 38, 14)},
        {"spacing": (1.5, 1.2, 4.2)},
        {"origin": (-30.5, 12.0, 7.0)},
        {"turn": (3, 0, 0)},
    ],
)
def test_different_grids(tmp_path, change):
    shape = change.pop("shape", MASK.shape)
    scans.write_nifti(tmp_path / "mask.nii", MASK, scans.affine_of())
    scans.write_nifti(tmp_path / "image.nii", np.zeros(shape, np.int16), scans.affine_of(**change))
    both = {"mask": "mask.nii", "image": "image.nii"}
    refused(tmp_path, "image.nii: its grid", "mask.nii", "resample: true", columns=both)
    scans.load(tmp_path, changes={"resample": True}, **both)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_image_that_is_not_finite(tmp_path, value):
    scans.write_nifti(tmp_path / "mask.nii", MASK, scans.affine_of())
    image = scans.grey(MASK > 0).astype(np.float32)
    image[20, 20, 5] = value
    scans.write_nifti(tmp_path / "image.nii", image, scans.affine_of())
    refused(tmp_path, "image.nii: 1 of its voxels", columns={"mask": "mask.nii", "image": "image.nii"})


def test_boundary_that_is_no_boundary(tmp_path):
    scans.write_nifti(tmp_path / "edges.nii", MASK * 0, scans.affine_of())
    refused(tmp_path, "boundary maps are empty", columns={"boundary": "edges.nii"})
    scans.write_nifti(tmp_path / "edges.nii", scans.grey(MASK > 0), scans.affine_of())
    refused(tmp_path, "different values", columns={"boundary": "edges.nii"})


def test_scan_of_one_grey_value(tmp_path):
    scans.write_nifti(tmp_path / "image.nii", np.zeros(MASK.shape, np.int16), scans.affine_of())
    refused(tmp_path, "image.nii", columns={"image": "image.nii"})


@pytest.fixture(scope="module")
def hospital(tmp_path_factory):
    """A series, its SEG and its RTSTRUCT."""
    folder = tmp_path_factory.mktemp("hospital")
    series = scans.write_series(folder / "dicom", scans.grey(MASK > 0), scans.dicom_affine())
    scans.write_seg(folder / "seg.dcm", {"organ": MASK > 0}, series, ["organ"])
    scans.write_structure_set(folder / "rt.dcm", {"organ": scans.outlines(MASK > 0, scans.dicom_affine())})
    scans.write_nifti(folder / "mask.nii", MASK, scans.dicom_affine())
    return folder


@pytest.fixture
def ward(hospital, tmp_path):
    return shutil.copytree(hospital, tmp_path / "ward")


IMAGE = {"image": "dicom", "mask": "mask.nii"}
SEG, RT = {"mask": "seg.dcm"}, {"mask": "rt.dcm"}


def test_missing_slices(ward):
    for name in ("035.dcm", "042.dcm"):
        (ward / "dicom" / name).unlink()
    said = ("2 slices are missing (a gap of 12 mm", "fill_gaps: true")
    refused(ward, *said, columns=IMAGE, fill_gaps=False)


def test_uneven_slices(tmp_path):
    heights = np.arange(14.0)
    heights[5] += 0.3
    scans.write_series(tmp_path / "dicom", scans.grey(MASK > 0), scans.dicom_affine(), heights=heights)
    scans.write_nifti(tmp_path / "mask.nii", MASK, scans.dicom_affine())
    refused(tmp_path, "unevenly spaced", columns=IMAGE, fill_gaps=False)


def test_tilted_gantry_and_a_mask_on_another_grid(tmp_path):
    affine = scans.dicom_affine()
    affine[1, 2] += 1.5
    scans.write_series(tmp_path / "dicom", scans.grey(MASK > 0), affine)
    scans.write_nifti(tmp_path / "mask.nii", MASK, scans.dicom_affine())
    refused(tmp_path, "its grid", "is not that of", columns=IMAGE)


def without(*numbers):
    """Removes slices of the series."""
    return lambda ward: [(ward / "dicom" / f"{number:03d}.dcm").unlink() for number in numbers]


def edited(change):
    """Changes the header of a slice."""

    def edit(ward):
        dataset = pydicom.dcmread(ward / "dicom" / "021.dcm")
        change(dataset)
        dataset.save_as(ward / "dicom" / "021.dcm")

    return edit


def second_time_point(ward):
    for path in sorted((ward / "dicom").iterdir()):
        dataset = pydicom.dcmread(path)
        dataset.SOPInstanceUID += ".1"
        dataset.save_as(path.with_name(f"again{path.name}"))


def second_series(ward):
    scans.write_series(ward / "dicom" / "b", scans.grey(MASK > 0), scans.dicom_affine(), uid="second")


def truncated_slice(ward):
    path = ward / "dicom" / "021.dcm"
    path.write_bytes(path.read_bytes()[:-500])


def no_slices(ward):
    shutil.rmtree(ward / "dicom")
    (ward / "dicom").mkdir()
    (ward / "dicom" / "notes.txt").write_text("no scan")


#: What is done to the ward, what the row names, and what the line says.
WARD = {
    "two time points": (second_time_point, IMAGE, ["several images lie at the position"]),
    "two series": (second_series, IMAGE, ["2 DICOM series", "b (CT series 1, 14 images)"]),
    "mixed geometry": (
        edited(lambda dataset: setattr(dataset, "PixelSpacing", ["1.0", "1.0"])),
        IMAGE,
        ["differs", "PixelSpacing"],
    ),
    "no position": (
        edited(lambda dataset: delattr(dataset, "ImagePositionPatient")),
        IMAGE,
        ["no ImagePositionPatient"],
    ),
    "a truncated slice": (truncated_slice, IMAGE, ["021.dcm", "cannot be decoded"]),
    "a folder without DICOM": (no_slices, IMAGE, ["no DICOM images in this folder"]),
    "a slice as mask": (without(), IMAGE | {"mask": "dicom/007.dcm"}, ["DICOM CT, not a mask"]),
    "a SEG of slices that are not there": (
        without(49, 56, 63, 70, 77, 84, 91),
        IMAGE | {"mask": "seg.dcm"},
        ["seg.dcm: it refers to", "that dicom does not have"],
    ),
    "no such segment": (without(), SEG | {"label": "liver"}, ["no segment 'liver'", "1 (organ)"]),
    "no such ROI": (without(), RT | {"label": "liver"}, ["no ROI 'liver'", "1 (organ)"]),
    "a boundary map beside contours": (
        nifti(MASK, scans.dicom_affine(), "edges.nii"),
        RT | {"boundary": "edges.nii"},
        ["boundary"],
    ),
}


@pytest.mark.parametrize(("spoil", "columns", "parts"), WARD.values(), ids=WARD)
def test_bad_dicom(ward, spoil, columns, parts):
    spoil(ward)
    refused(ward, *parts, columns=columns)


def test_truncated_seg_and_rtstruct(ward):
    for name in ("seg.dcm", "rt.dcm"):
        content = (ward / name).read_bytes()
        (ward / name).write_bytes(content[: len(content) // 3])
        refused(ward, name, columns={"mask": name, "image": "dicom"})


def drawn(folder, contours, *parts, kind="CLOSED_PLANAR", **columns):
    scans.write_structure_set(folder / "rt.dcm", {"organ": contours}, kind=kind)
    refused(folder, "rt.dcm: ", *parts, columns={"mask": "rt.dcm", **columns})


RINGS = [circle(z) for z in range(5)]
CROSSED = np.array([(0, 0, 5), (10, 10, 5), (10, 0, 5), (0, 10, 5)], float)
HOLED = changed(circle(2), 3, np.nan)
#: Contours, how they are drawn, and what the line says.
CONTOURS = {
    "open": (RINGS, "OPEN_PLANAR", "open contour"),
    "points": ([ring[:1] for ring in RINGS], "POINT", "points only"),
    "crossed": ([*RINGS, CROSSED], "CLOSED_PLANAR", "crosses itself"),
    "two that cross": ([*RINGS, circle(3, centre=(12.0, 0.0))], "CLOSED_PLANAR", "cross each other"),
    "in other planes": ([*RINGS, circle(4)[:, [2, 0, 1]]], "CLOSED_PLANAR", "parallel planes"),
    "lines": ([ring[:2] for ring in RINGS], "CLOSED_PLANAR", "encloses an area"),
    "turning lines": ([circle(z)[[z, z + 10]] for z in range(5)], "CLOSED_PLANAR", "encloses an area"),
    "a line": ([circle(0)[:2]], "CLOSED_PLANAR", "encloses an area"),
    "not finite": ([*RINGS[:2], HOLED, *RINGS[3:]], "CLOSED_PLANAR", "not finite"),
}


@pytest.mark.parametrize(("contours", "kind", "problem"), CONTOURS.values(), ids=CONTOURS)
def test_bad_contours(tmp_path, contours, kind, problem):
    drawn(tmp_path, contours, problem, kind=kind)


def test_contours_across_the_slices(ward):
    tilt = Rotation.from_euler("x", 20, degrees=True).as_matrix()
    contours = [circle(z) @ tilt.T for z in range(5)]
    drawn(ward, contours, "not parallel to the image's slices", image="dicom")


def test_roi_without_contours(tmp_path):
    scans.write_structure_set(tmp_path / "rt.dcm", {"organ": [], "body": [circle(1)]})
    columns = {"mask": "rt.dcm", "label": "organ"}
    refused(tmp_path, "'organ' has no contours", "choose one of body", columns=columns)


@pytest.mark.parametrize(
    ("frames", "words"),
    [([*range(14), 3], "Multiple frames"), ([*range(5), *range(6, 14)], "regularly-spaced")],
)
def test_frames_that_are_no_volume(tmp_path, frames, words):
    scans.write_enhanced(tmp_path / "enhanced.dcm", scans.grey(MASK > 0), scans.dicom_affine(), frames)
    refused(tmp_path, "no volume can be made of its frames", words, columns={"image": "enhanced.dcm"})


#: Headers over which ITK's C libraries end the process: what stands there, and what instead.
CRASHES = [
    ("mask.mha", b"ElementDataFile = LOCAL", b"ElementDataFile = %s%n%d"),
    ("mask.mha", b"ElementDataFile = LOCAL", b"ElementDataFile = x%d 1 2 0"),
    ("mask.mha", b"NDims = 3", b"NDims = -1"),
    ("mask.mha", b"NDims = 3", b"NDims = 99999999999"),
    ("mask.nrrd", b"encoding: gzip", b"encoding: " + b"A" * 3000),
    ("mask.nrrd", b"encoding: gzip", b"encoding: ascii"),
]


@pytest.mark.parametrize(("name", "field", "instead"), CRASHES)
def test_headers_that_crash_a_library(tmp_path, name, field, instead):
    content = scans.write_itk(tmp_path / name, MASK, scans.affine_of()).read_bytes()
    assert field in content
    (tmp_path / name).write_bytes(content.replace(field, instead))
    refused(tmp_path, name, columns={"mask": name})


@pytest.mark.parametrize("name", ["mask.nii", "mask.mhd"])
def test_a_header_that_promises_a_huge_volume_fills_no_memory(tmp_path, name):
    write = scans.write_nifti if name.endswith("nii") else scans.write_itk
    path = write(tmp_path / name, MASK, scans.affine_of())
    content = bytearray(path.read_bytes())
    if name.endswith("nii"):
        content[42:48] = np.array([2000, 2000, 900], "<i2").tobytes()
    else:
        content = content.replace(b"DimSize = 44 38 14", b"DimSize = 2000 2000 900")
    path.write_bytes(content)
    refused(tmp_path, "promises more voxels", columns={"mask": name})


def loads_or_refuses(folder, columns):
    """Either a structure or one line; any other error fails the test."""
    try:
        structure = scans.load(folder, **columns)
    except InputError as error:
        assert "\n" not in str(error)  # noqa: PT017
        assert str(error).startswith("cohort.tsv row 2: ")  # noqa: PT017
    else:
        assert structure.contours or structure.mask.any()


# a broken file may make pydicom and nibabel warn before they give up
pytestmark = pytest.mark.filterwarnings("ignore")

once = hypothesis_settings(max_examples=30, deadline=None, suppress_health_check=list(HealthCheck))


@pytest.mark.parametrize("suffix", ["nii", "nii.gz", "nrrd", "mha"])
@once
@given(data=st.data())
def test_damaged_bytes(tmp_path_factory, suffix, data):
    """Bytes changed, cut or added anywhere in a file."""
    folder = tmp_path_factory.getbasetemp()
    path = folder / f"mask.{suffix}"
    small = MASK[10:24, 10:24, 3:9]
    write = scans.write_nifti if suffix.startswith("nii") else scans.write_itk
    write(path, np.ascontiguousarray(small), scans.affine_of())
    content = bytearray(gzip.decompress(path.read_bytes()) if suffix == "nii.gz" else path.read_bytes())
    header = min(len(content), 352)
    for _ in range(data.draw(st.integers(1, 4))):
        content[data.draw(st.integers(0, header - 1))] = data.draw(st.integers(0, 255))
    content = content[: data.draw(st.integers(0, len(content)) | st.just(len(content)))]
    path.write_bytes(gzip.compress(bytes(content)) if suffix == "nii.gz" else bytes(content))
    loads_or_refuses(folder, {"mask": path.name})


@once
@given(st.binary(max_size=600), st.sampled_from(["nii", "nii.gz", "nrrd", "mha", "dcm", "png", "xyz"]))
def test_any_bytes(tmp_path_factory, content, suffix):
    folder = tmp_path_factory.getbasetemp()
    (folder / f"any.{suffix}").write_bytes(content)
    loads_or_refuses(folder, {"mask": f"any.{suffix}"})


@once
@given(st.integers(132, 3000), st.integers(0, 255), st.sampled_from(["seg.dcm", "rt.dcm", "dicom/049.dcm"]))
def test_damaged_dicom(hospital, tmp_path_factory, where, value, name):
    folder = tmp_path_factory.getbasetemp() / "damaged"
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(hospital, folder)
    content = bytearray((folder / name).read_bytes())
    content[where % len(content)] = value
    (folder / name).write_bytes(bytes(content))
    loads_or_refuses(folder, {"image": "dicom", "mask": name if "/" not in name else "mask.nii"})


@once
@given(
    st.lists(st.lists(st.tuples(*[st.floats(-20, 20)] * 2), min_size=1, max_size=7), min_size=1, max_size=5)
)
def test_any_contours_give_simple_curves_or_a_line(tmp_path_factory, shapes):
    import shapely

    folder = tmp_path_factory.getbasetemp()
    contours = [circle(z) for z in range(5)]
    contours += [np.column_stack([np.add(s, (40, 0)), np.full(len(s), 2.0)]) for s in shapes]
    scans.write_structure_set(folder / "any.dcm", {"organ": contours})
    try:
        curves = scans.load(folder, mask="any.dcm").contours
    except InputError as error:
        assert "\n" not in str(error)  # noqa: PT017
    else:
        assert all(shapely.LinearRing(points).is_simple for points in curves)


@pytest.mark.parametrize(("apart", "said"), [(50.0, True), (0.2, False)])
def test_two_affines_that_disagree_are_said(tmp_path, apart, said):
    mask = np.zeros((8, 9, 10), np.uint8)
    mask[2:6, 2:6, 2:6] = 1
    moved = np.eye(4)
    moved[0, 3] = apart
    image = nibabel.Nifti1Image(mask, np.eye(4))
    image.set_qform(moved, 1)
    image.set_sform(np.eye(4), 1)
    nibabel.save(image, tmp_path / "mask.nii")
    notes = read_volume(tmp_path / "mask.nii").warnings
    line = "mask.nii: its sform and qform put it up to 50 mm apart; the sform is used"
    assert notes == ([line] if said else [])
    assert (line in cccd.read(tmp_path / "mask.nii").warnings) == said


@pytest.mark.parametrize("asked", ["zero.nii.gz", "mask.nii.gz"])
def test_a_name_is_near_by_itself_and_not_by_its_suffix(tmp_path, asked):
    (tmp_path / "one.nii.gz").write_bytes(b"")
    (tmp_path / "masks").mkdir()
    with pytest.raises(InputError, match=f"there is no {asked} in .*; correct the path"):
        existing(tmp_path / asked, "mask")


@pytest.mark.parametrize(("asked", "hint"), [("splen", "did you mean 'spleen'?"), ("9", "choose one of 5 ")])
def test_a_label_is_near_the_name_of_another(asked, hint):
    with pytest.raises(InputError, match=f"it has no label '{asked}'; {re.escape(hint)}"):
        choose_labels({5: "liver", 7: "spleen", 8: ""}, asked, "organ", "scan.nii", "label")
