"""A SEG or RTSTRUCT and its series, in one folder or in several: which belongs to which is found."""

import numpy as np
import pydicom
import pytest
import shapely
from pydicom.dataset import Dataset
from support import scans
from support.refusals import refusal

import cccd
from cccd_labels.label_maps import list_map

AFFINE = scans.affine_of()


@pytest.fixture
def organ():
    return scans.organ()


def write(folder, organ, uid="series"):
    """A series of the organ in a folder."""
    return scans.write_series(folder, scans.grey(organ), AFFINE, uid=uid)


def write_contours(path, organ, series, affine=AFFINE):
    """An RTSTRUCT that refers to a series as planning systems do."""
    scans.write_structure_set(path, {"liver": scans.outlines(organ, affine)})
    ds = pydicom.dcmread(path)
    frame, study, one = Dataset(), Dataset(), Dataset()
    one.SeriesInstanceUID = series[0].SeriesInstanceUID
    study.RTReferencedSeriesSequence = [one]
    frame.FrameOfReferenceUID = ds.FrameOfReferenceUID
    frame.RTReferencedStudySequence = [study]
    ds.ReferencedFrameOfReferenceSequence = [frame]
    ds.save_as(path)


@pytest.mark.parametrize("kind", ["SEG", "RTSTRUCT"])
def test_labels_of_an_object_among_its_series_are_listed(tmp_path, organ, kind):
    series = write(tmp_path, organ)
    if kind == "SEG":
        scans.write_seg(tmp_path / "seg.dcm", {"liver": organ}, series, ["liver"])
    else:
        write_contours(tmp_path / "rt.dcm", organ, series)
    assert [label.organ for label in list_map(tmp_path)] == ["liver"]
    surfaces, failures = cccd.reconstruct_labels(tmp_path)
    assert [surface.name for surface in surfaces] == ["liver"]
    assert not failures


def test_one_of_two_objects_is_taken_by_its_name(tmp_path, organ):
    series = write(tmp_path, organ)
    scans.write_seg(tmp_path / "seg.dcm", {"liver": organ}, series, ["liver"])
    write_contours(tmp_path / "rt.dcm", organ, series)
    for image in (tmp_path, None):  # an object lies in the folder of its series
        surface = cccd.reconstruct(cccd.read(tmp_path / "rt.dcm", image=image))
        surface.write(tmp_path.parent / "out.dcm")
        assert not [note for note in surface.warnings if "no image given" in note]


def test_of_two_series_the_one_is_taken_that_the_object_refers_to(tmp_path, organ):
    series = write(tmp_path / "all" / "first", organ)
    write(tmp_path / "all" / "second", organ[::-1], uid="other")
    scans.write_seg(tmp_path / "seg.dcm", {"liver": organ}, series, ["liver"])
    structure = cccd.read(tmp_path / "seg.dcm", image=tmp_path / "all")
    assert np.corrcoef(structure.image.ravel(), structure.mask.ravel())[0, 1] > 0.5
    mask = scans.write_nifti(tmp_path / "m.nii.gz", organ.astype(np.uint8), AFFINE)
    assert "2 DICOM series in this folder" in refusal(cccd.read, mask, image=tmp_path / "all")


@pytest.mark.parametrize(("given", "uid"), [(".", "series"), ("rt.dcm", "series"), ("rt.dcm", "")])
def test_contours_on_the_scan_s_last_slice_may_be_cut_there(tmp_path, organ, given, uid):
    cut = organ.copy()
    cut[..., -3:] = organ[..., [6]]
    series = write(tmp_path, cut, uid)  # anonymising may take it
    write_contours(tmp_path / "rt.dcm", cut, series)
    (note,) = [note for note in cccd.read(tmp_path / given).warnings if "may be cut" in note]
    assert note == "the organ touches the scan's last slice: it may be cut there"


@pytest.mark.parametrize(("end", "name"), [(slice(0, 3), "first"), (slice(-3, None), "last")])
def test_a_seg_alone_names_the_end_at_which_its_series_does(tmp_path, organ, end, name):
    cut = organ.copy()
    cut[..., end] = organ[..., [6]]
    cut[..., 7 if name == "first" else 6] |= True  # both ends would look alike otherwise
    cut[..., {"first": slice(9, None), "last": slice(0, 4)}[name]] = False
    series = write(tmp_path / "series", cut)
    every = np.ones_like(cut)  # a second segment has a frame on each slice
    scans.write_seg(tmp_path / "seg.dcm", {"liver": cut, "body": every}, series, ["liver", "body"])
    alone = cccd.read(tmp_path / "seg.dcm", "liver")
    beside = cccd.read(tmp_path / "seg.dcm", "liver", image=tmp_path / "series")
    notes = [[note for note in one.warnings if "may be cut" in note] for one in (alone, beside)]
    assert notes[0] == notes[1]
    assert f"the scan's {name} slice" in notes[0][0]
    assert alone.frame.slice_axis == beside.frame.slice_axis == 2
    np.testing.assert_allclose(alone.frame.affine, beside.frame.affine, atol=1e-4)
    np.testing.assert_array_equal(scans.full(alone), scans.full(beside))


def test_a_seg_that_ends_before_its_series_is_not_cut_there(tmp_path, organ):
    assert organ[..., 2].any()
    inner = organ.copy()
    inner[..., [0, 1, -2, -1]] = False
    series = write(tmp_path / "series", inner)
    scans.write_seg(tmp_path / "seg.dcm", {"liver": inner}, series, ["liver"])
    structure = cccd.read(tmp_path / "seg.dcm")
    assert not [note for note in structure.warnings if "may be cut" in note]


def test_regions_without_contours_keep_no_other_from_its_surface(tmp_path, organ):
    two = organ.copy()
    two[..., :6] = two[..., 8:] = False
    drawn = {name: scans.outlines(mask, AFFINE) for name, mask in {"liver": organ, "spleen": two}.items()}
    scans.write_structure_set(tmp_path / "rt.dcm", drawn | {"couch": []})
    surfaces, failures = cccd.reconstruct_labels(tmp_path / "rt.dcm")
    assert [surface.name for surface in surfaces] == ["liver", "spleen"]
    (line,) = failures
    assert "'couch' has no contours" in line


@pytest.mark.parametrize("count", [1, 2])
def test_an_organ_on_one_or_two_slices_is_a_surface_with_a_warning(tmp_path, count):
    mask = np.zeros((40, 40, 12), np.uint8)
    mask[10:30, 8:32, 5 : 5 + count] = 1
    affine = np.diag([1.0, 1.0, 3.0, 1.0])
    surface = cccd.reconstruct(mask, affine)
    voxels = mask.sum() * 3
    assert surface.volume == pytest.approx(voxels, rel=0.15)
    lies = f"mask lies on {count} {'slice' if count == 1 else 'slices'} along axis 2"
    assert f"{lies}: where it ends above and below is a guess" in surface.warnings
    series = scans.write_series(tmp_path, scans.grey(mask > 0), affine)
    write_contours(tmp_path / "rt.dcm", mask, series, affine)
    drawn = cccd.reconstruct(cccd.read(tmp_path))
    assert drawn.volume == pytest.approx(voxels, rel=0.15)
    masks = {"organ": mask, "couch": np.pad(mask[..., 5:6], ((0, 0), (0, 0), (2, 2)), "edge")}
    path = tmp_path.with_suffix(".dcm")  # away from its series; the couch says how thick a slice is
    scans.write_structure_set(path, {name: scans.outlines(of, affine) for name, of in masks.items()})
    alone = cccd.read(path, "organ")
    assert cccd.reconstruct(alone).volume == pytest.approx(voxels, rel=0.15)
    assert (count == 1) == any("one plane, taken as 3 mm thick" in note for note in alone.warnings)


@pytest.mark.parametrize("corners", ["kept", "cut"])
def test_contours_along_pixels_get_the_size_of_these(tmp_path, corners):
    """Of a ball of 20 mm that was traced along pixels of 3 mm, or by marching squares, as exports do."""
    size, contours = 3.0, []
    for z in np.arange(-18.0, 18.1, 3.0):
        at = np.arange(-9, 9) * size
        inside = [(x, y) for x in at for y in at if (x + 1.5) ** 2 + (y + 1.5) ** 2 + z**2 <= 400]
        outline = shapely.union_all([shapely.box(x, y, x + size, y + size) for x, y in inside])
        ring = shapely.get_coordinates(outline.segmentize(size).exterior)[:-1]
        ring = (ring + np.roll(ring, int(corners == "cut"), axis=0)) / 2
        contours.append(np.column_stack([ring, np.full(len(ring), z)]))
    scans.write_structure_set(tmp_path / "rt.dcm", {"ball": contours})
    structure = cccd.read(tmp_path / "rt.dcm")
    assert structure.frame.spacing == pytest.approx((3, 3, 3))
    assert "rt.dcm: no image given, pixels of 3 mm along whose edges its contours run" in structure.warnings
    surface = cccd.reconstruct(structure)
    assert surface.mesh.euler_number == 2
    away = np.linalg.norm(surface.vertices, axis=1) - 20
    assert np.abs(away).mean() < 0.5  # a sixth of a pixel: no stairs


@pytest.mark.parametrize(("kept", "why"), [(0, "not DICOM"), (500, "ends too early")])
def test_a_slice_that_cannot_be_read_is_named_and_not_left_out(tmp_path, organ, kept, why):
    series = write(tmp_path, organ)
    write_contours(tmp_path / "rt.dcm", organ, series)
    last = sorted(tmp_path.glob("[!r]*.dcm"))[-1]
    last.write_bytes(last.read_bytes()[:kept])
    with pytest.raises(cccd.InputError, match=f"{last.name}: it is .*{why}"):
        cccd.read(tmp_path)
