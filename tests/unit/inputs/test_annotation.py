"""Slices that nobody drew: which they are, and what the surface makes of them."""

import nibabel
import numpy as np
import pytest
from support.refusals import refusal
from support.scans import load, settings, write_nifti

import cccd
from cccd.containers import Annotation, Sections
from cccd.contours import trace_contours
from cccd.errors import InputError
from cccd.inputs import structure_of_array
from cccd.inputs.annotation import drawn_slices, find_annotation
from cccd.settings.surface import LoftSettings
from cccd.store import read_drawn, read_structure, write_structure
from cccd.surface.loft import loft_surface
from cccd_workflow.cohort import read_cohort
from cccd_workflow.stage_files import read_compared
from cccd_workflow.surface_measures import measure_surface

ORIGIN = np.array([3, 10, 20])


def ellipsoid(shape=(60, 56, 80), radii=(22.0, 18.0, 30.0)):
    centre = (np.array(shape) - 1) / 2
    offset = np.indices(shape) - centre.reshape(3, 1, 1, 1)
    return ((offset / np.reshape(radii, (3, 1, 1, 1))) ** 2).sum(axis=0) <= 1


def only(mask, slices):
    """The mask with these of its slices alone."""
    kept = np.zeros_like(mask)
    kept[:, :, slices] = mask[:, :, slices]
    return kept


def found(mask, rule="auto"):
    return find_annotation(np.moveaxis(mask, 2, 0), ORIGIN, rule, "mask")


@pytest.mark.parametrize("slices", [range(12, 70, 5), range(12, 70, 10), [11, 14, 25, 40, 45, 64]])
def test_gaps_between_drawn_slices_are_not_empty_slices(slices):
    annotation = found(only(ellipsoid(), list(slices)))
    assert annotation.slices.tolist() == [k + 3 for k in slices]
    assert annotation.guides == ()


def two_parts():
    mask = ellipsoid()
    mask[:, :, 30:50] = False
    return mask


def one_empty_slice():
    mask = ellipsoid()
    mask[:, :, 40] = False
    return mask


def every_second():
    return only(ellipsoid(), list(range(10, 70, 2)))


def scattered_spots():
    mask = np.zeros((60, 56, 80), bool)
    for n, k in enumerate((5, 20, 35, 50)):
        mask[10 * n + 5 : 10 * n + 9, 8:12, k] = True
    return mask


def thin_sheet():
    mask = np.zeros((60, 56, 80), bool)
    mask[30, 10:40, 5:70] = True
    return mask


@pytest.mark.parametrize(
    "make", [ellipsoid, two_parts, one_empty_slice, every_second, scattered_spots, thin_sheet]
)
def test_organs_with_gaps_of_their_own_are_taken_as_they_are(make):
    assert found(make()) is None
    assert found(make(), "every slice") is None


def test_a_word_in_the_sheet_overrules_the_gaps():
    assert len(found(every_second(), "nonempty").slices) == 30
    assert found(only(ellipsoid(), [12, 30, 50]), "every slice") is None
    assert found(ellipsoid(), "nonempty") is None


def with_planes(mask, slices, i=(), j=()):
    drawn = only(mask, slices)
    drawn[list(i)] = mask[list(i)]
    drawn[:, list(j)] = mask[:, list(j)]
    return drawn


@pytest.mark.parametrize("slices", [[14, 26, 33, 47, 60], list(range(11, 70, 2))], ids=["far", "near"])
@pytest.mark.parametrize(("i", "j"), [((30,), ()), ((), (25,)), ((20, 36), (28,)), ((25, 30, 35), (20, 30))])
def test_planes_across_the_slices_are_told_from_slices(i, j, slices):
    mask = ellipsoid()
    annotation = found(with_planes(mask, slices, i, j), "nonempty")
    assert annotation.slices.tolist() == [k + 3 for k in slices]
    planes = [(guide.axis, guide.index) for guide in annotation.guides]
    assert planes == [(0, n + 10) for n in i] + [(1, n + 20) for n in j]
    for guide in annotation.guides:
        whole = (mask[guide.index - 10] if guide.axis == 0 else mask[:, guide.index - 20]).T
        assert np.array_equal(guide.inside, whole)
        assert guide.origin.tolist() == [3, (20, 10)[guide.axis]]


def test_a_mask_of_every_slice_has_no_planes_across():
    assert drawn_slices(np.moveaxis(ellipsoid(), 2, 0))[1] == []


@pytest.mark.parametrize(
    ("slices", "off"),
    [(range(12, 70, 5), 0.02), ([11, 14, 25, 35, 45, 50, 64], 0.04), (range(14, 70, 10), 0.04)],
)
def test_an_ellipsoid_of_some_slices_is_whole(slices, off):
    mask = ellipsoid()
    surface = cccd.reconstruct(only(mask, list(slices)))
    assert surface.mesh.is_watertight
    assert surface.lofted.report["bodies"] == 1
    assert surface.volume == pytest.approx(4 / 3 * np.pi * 22 * 18 * 30, rel=off)
    assert sum("are filled" in warning for warning in surface.warnings) == 1


def test_the_label_map_is_whole_and_keeps_what_was_drawn(tmp_path):
    mask, slices = ellipsoid(), [11, 14, 25, 35, 45, 50, 64]
    mask[28:32, 25:30] = False  # a hole
    drawn = only(mask, slices)
    drawn[slices[2] % 7 :: 11, 40, slices[2]] ^= True  # no surface would follow that
    affine = np.array([[-0.9, 0, 0, 30], [0, 0, 1.5, -20], [0, 0.8, 0, 5], [0, 0, 0, 1]])
    write_nifti(tmp_path / "drawn.nii.gz", drawn.astype(np.uint8), affine)
    structure = cccd.read(tmp_path / "drawn.nii.gz", annotated="nonempty")
    cccd.reconstruct(structure).write(tmp_path / "filled.nii.gz")
    filled = nibabel.load(tmp_path / "filled.nii.gz")
    assert filled.shape == mask.shape
    assert filled.get_data_dtype() == np.uint8
    assert np.allclose(filled.affine, affine)
    assert filled.header["qform_code"] == filled.header["sform_code"] == 1
    values = np.asarray(filled.dataobj) > 0
    assert np.array_equal(values[:, :, slices], drawn[:, :, slices])
    assert 2 * (values & mask).sum() / (values.sum() + mask.sum()) > 0.97
    assert not values[:, :, :5].any()


def test_drawn_contours_far_apart_are_one_organ():
    curves = trace_contours(structure_of_array(only(ellipsoid(), [12, 16, 20, 64]), np.eye(4), settings()))
    known = Annotation(np.array([12, 16, 20, 64]))
    bodies = [
        loft_surface(Sections(curves, annotation=some), LoftSettings()).report["bodies"]
        for some in (None, known)
    ]
    assert bodies == [2, 1]


def test_parts_that_lie_beside_each_other_are_one_organ():
    i, j, k = np.indices((80, 40, 61))
    tube = np.hypot(i - 15 - 0.8 * k, j - 20) <= 6
    surface = cccd.reconstruct(only(tube, list(range(0, 61, 20))), annotated="nonempty")
    assert surface.lofted.report["bodies"] == 1
    assert surface.volume == pytest.approx(tube.sum(), rel=0.02)


def test_a_part_without_a_next_one_ends_half_way():
    i, j, k = np.indices((70, 30, 81))
    long, short = np.hypot(i - 15, j - 15) <= 7, (np.hypot(i - 52, j - 15) <= 9) & (k > 28)
    surface = cccd.reconstruct(only(long | short, list(range(0, 81, 20))))
    assert surface.lofted.report["bodies"] == 2
    ends = surface.vertices[surface.vertices[:, 0] > 33, 2]
    assert 28 < ends.min() < 33
    assert any("they end half way" in warning for warning in surface.warnings)


def bent_tube():
    i, j, k = np.indices((60, 70, 81))
    return np.hypot(i - 30, j - 35 - 12 * np.sin(np.pi * k / 40)) <= 9


def overlap(surface, mask, tmp_path):
    surface.write(tmp_path / "filled.nii.gz")
    filled = np.asarray(nibabel.load(tmp_path / "filled.nii.gz").dataobj) > 0
    return 2 * (filled & mask).sum() / (filled.sum() + mask.sum())


@pytest.mark.parametrize("axes", [(0, 1, 2), (2, 0, 1)])
def test_a_plane_across_guides_a_bent_tube(tmp_path, axes):
    tube, slices = bent_tube(), [0, 40, 80]
    planes = [only(tube, slices), with_planes(tube, slices, i=[30])]
    turned = cccd.Settings.model_validate({"import": {"slice_axis": axes.index(2)}})
    alone, guided = (
        overlap(cccd.reconstruct(drawn.transpose(axes), settings=turned), tube.transpose(axes), tmp_path)
        for drawn in planes
    )
    assert alone < 0.7
    assert guided > 0.96


def test_a_plane_across_says_where_an_organ_ends():
    mask, slices = ellipsoid(), [12, 20, 40, 55, 62]
    ends = [
        np.sort(cccd.reconstruct(drawn).vertices[:, 2])[[0, -1]]
        for drawn in (with_planes(mask, slices, i=[30]), only(mask, slices))
    ]
    assert np.abs(ends[0] - [9.5, 69.5]).max() < 0.8
    assert np.abs(ends[1] - [9.5, 69.5]).max() > 1.5


def test_what_was_drawn_is_stored_and_is_all_that_is_measured_against(tmp_path):
    mask, slices = ellipsoid(), list(range(12, 70, 8))
    drawn = with_planes(mask, slices, j=[27])
    write_nifti(tmp_path / "liver.nii.gz", drawn.astype(np.uint8), np.diag([1, 1, 1.5, 1]))
    structure = load(tmp_path, mask="liver.nii.gz", annotated="nonempty")
    write_structure(tmp_path / "structure.h5", structure)
    stored = read_drawn(tmp_path / "structure.h5").annotation
    assert np.array_equal(stored.slices, slices)
    assert np.array_equal(stored.guides[0].inside, structure.annotation.guides[0].inside)
    assert np.array_equal(stored.guides[0].origin, structure.annotation.guides[0].origin)
    assert read_structure(tmp_path / "structure.h5").mask.any(axis=(0, 1)).sum() == len(slices)
    assert read_compared(tmp_path / "structure.h5").mask is None
    figures = measure_surface(cccd.reconstruct(structure).lofted, structure)
    assert figures["dice_3d"] > 0.97
    assert not any(name.startswith(("assd", "volume_bias")) for name in figures)


@pytest.mark.parametrize(
    ("columns", "problem"),
    [
        ({"annotated": "nonempty", "image": "a.nii"}, "annotated: nonempty needs a mask"),
        ({"annotated": "nonempty", "mask": "a.nii", "boundary": "b.nii"}, "annotated: nonempty needs a mask"),
        ({"annotated": "nonempty", "mask": "a.nii", "role": "train"}, "annotated: nonempty needs a mask"),
        ({"annotated": "nonempti", "mask": "a.nii"}, "annotated 'nonempti' is not known"),
    ],
)
def test_the_sheet_refuses_what_makes_no_sense(tmp_path, columns, problem):
    columns = {"case": "a", "organ": "liver", **columns}
    (tmp_path / "sheet.tsv").write_text("\t".join(columns) + "\n" + "\t".join(columns.values()) + "\n")
    with pytest.raises(InputError, match=problem):
        read_cohort(tmp_path / "sheet.tsv")


@pytest.mark.parametrize("planes", [[], [30]])
def test_one_drawn_slice_is_too_few(tmp_path, planes):
    write_nifti(
        tmp_path / "liver.nii.gz", with_planes(ellipsoid(), [40], i=planes).astype(np.uint8), np.eye(4)
    )
    with pytest.raises(InputError, match=r"1 slice\b"):
        load(tmp_path, mask="liver.nii.gz", annotated="nonempty")


def test_probabilities_are_known_on_every_slice(tmp_path):
    share = 0.7 * only(ellipsoid(), [20, 40, 60]).astype(np.float32)
    write_nifti(tmp_path / "liver.nii.gz", share, np.eye(4))
    assert "combined with probabilities" in refusal(load, tmp_path, mask="liver.nii.gz", annotated="nonempty")
