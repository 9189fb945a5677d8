"""Drawn contours that other programs get wrong: holes, any order of points, other planes, contact."""

import numpy as np
import pydicom
import pytest
from support.scans import dicom_affine, grey, load, organ, write_series, write_structure_set

from cccd.geometry.polygons import RaggedPolygons

OUTER = np.array([(0, 0), (24, 0), (24, 20), (0, 20)], float)
HOLE = np.array([(6, 5), (6, 15), (16, 15), (16, 5)], float)
ISLAND = np.array([(9, 8), (13, 8), (13, 12), (9, 12)], float)
HEIGHTS = (0.0, 3.0, 6.0, 9.0)


def stacked(*shapes, heights=HEIGHTS):
    return [np.column_stack([shape, np.full(len(shape), z)]) for z in heights for shape in shapes]


def curves_of(folder, contours, kind="CLOSED_PLANAR", **columns):
    write_structure_set(folder / "rt.dcm", {"ring": contours}, kind)
    return load(folder, mask="rt.dcm", **columns).contours


def areas(curves):
    """Signed areas by slice: outlines count, holes are taken off."""
    return [sorted(RaggedPolygons.of(part).signed_areas.tolist()) for part in by_slice(curves)]


def by_slice(curves):
    loops = list(curves)
    return [[loops[n] for n in np.flatnonzero(curves.slice == k)] for k in np.unique(curves.slice)]


def keyhole(outer, inner):
    """One contour that walks to the hole, around it, and back along the same line."""
    return np.vstack([outer, outer[:1], inner, inner[:1]])


# dcmrtstruct2nii#32, platipy#244, SlicerRT#171, cornerstone3D#2477: there holes are filled, or leave a slit
WAYS = {
    "keyhole": ([keyhole(OUTER, HOLE)], "CLOSED_PLANAR"),
    "keyhole, the hole in the outline's sense": ([keyhole(OUTER, HOLE[::-1])], "CLOSED_PLANAR"),
    "exclusive or": ([OUTER, HOLE], "CLOSEDPLANAR_XOR"),
    "one within the other": ([HOLE[::-1], OUTER[::-1]], "CLOSED_PLANAR"),
}


@pytest.mark.parametrize("way", WAYS)
def test_a_hole_is_a_hole_however_it_was_drawn(tmp_path, way):
    shapes, kind = WAYS[way]
    curves = curves_of(tmp_path, stacked(*shapes), kind)
    assert areas(curves) == [pytest.approx([-100, 480])] * 4
    assert np.array_equal(curves.hole, curves.polygons.signed_areas < 0)


def test_an_island_in_a_hole_is_tissue(tmp_path):
    curves = curves_of(tmp_path, stacked(ISLAND, OUTER, HOLE), "CLOSEDPLANAR_XOR")
    assert areas(curves) == [pytest.approx([-100, 16, 480])] * 4


def test_the_order_of_points_and_of_contours_does_not_matter(tmp_path):
    rng = np.random.default_rng(5)
    drawn = stacked(OUTER, HOLE)
    turned = [np.roll(part[:: rng.choice((1, -1))], rng.integers(4), axis=0) for part in drawn]
    mixed = [turned[n] for n in rng.permutation(len(turned))]
    plain, other = curves_of(tmp_path, drawn), curves_of(tmp_path, mixed)
    assert areas(plain) == areas(other)
    assert np.array_equal(plain.frame.affine, other.frame.affine)


@pytest.mark.filterwarnings("ignore:The value for the data element:UserWarning")
def test_contours_of_more_than_64_kb_are_read(tmp_path):
    """In explicit syntax they have no type (PS3.5, 6.2.2); pydicom leaves them as bytes."""
    turns = np.linspace(0, 2 * np.pi, 4000, endpoint=False)
    circle = 10 + 8 * np.column_stack([np.cos(turns), np.sin(turns)])
    curves = curves_of(tmp_path, stacked(circle))
    assert (
        len(pydicom.dcmread(tmp_path / "rt.dcm").ROIContourSequence[0].ContourSequence[0].ContourData) > 2**16
    )
    assert areas(curves) == [pytest.approx([64 * np.pi], rel=1e-5)] * 4


def test_contours_between_the_slices_stay_where_they_were_drawn(tmp_path):
    mask, affine = organ(), dicom_affine()
    write_series(tmp_path / "dicom", grey(mask), affine)
    centre = affine @ (18, 18, 0, 1)
    low = affine[2, 3]
    heights = [low + 4.0 * (k + 0.4) for k in range(2, 8)]  # slices lie 4 mm apart
    shape = 0.5 * (OUTER - 10) + (-centre[0], -centre[1])  # LPS
    write_structure_set(tmp_path / "rt.dcm", {"box": stacked(shape, heights=heights)})
    structure = load(tmp_path, image="dicom", mask="rt.dcm")
    curves = structure.contours
    world = np.concatenate(
        [curves.frame.to_world(points, k) for points, k in zip(curves, curves.slice, strict=True)]
    )
    np.testing.assert_allclose(np.unique(world[:, 2].round(4)), heights, atol=1e-3)
    expected = np.sort((shape * -1).max(axis=0)), np.sort((shape * -1).min(axis=0))
    np.testing.assert_allclose(np.sort(world[:, :2].max(axis=0)), expected[0], atol=1e-3)
    np.testing.assert_allclose(np.sort(world[:, :2].min(axis=0)), expected[1], atol=1e-3)
    assert structure.image is None
    assert any("do not lie on the slices" in note for note in structure.warnings)


TOUCHING = {
    "along a side": OUTER + np.array([24, 0]),
    "along part of a side": OUTER + np.array([24, 7]),
    "in a corner": OUTER + np.array([24, 20]),
}


@pytest.mark.parametrize("where", TOUCHING)
def test_two_contours_that_touch_are_both_kept(tmp_path, where):
    curves = curves_of(tmp_path, stacked(OUTER, TOUCHING[where]))
    assert not curves.hole.any()
    assert [sum(part) for part in areas(curves)] == pytest.approx([960] * 4)


def test_a_hole_that_touches_its_outline_is_a_bay(tmp_path):
    bay = np.array([(0, 5), (8, 5), (8, 12), (0, 12)], float)
    curves = curves_of(tmp_path, stacked(OUTER, bay), "CLOSEDPLANAR_XOR")
    assert [sum(part) for part in areas(curves)] == pytest.approx([480 - 56] * 4)
