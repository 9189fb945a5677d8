"""Which tubes a stack is made of, where they branch, and how they end, on shapes whose answer is known."""

import numpy as np
import pytest
import shapely
from shapes import SETTINGS, ball, curves_of, drawn, ellipse, fork, grid

from cccd.geometry.polygons import signed_area
from cccd.surface import loft_surface
from cccd.surface.caps import rounded_cap
from cccd.surface.matching import match_contours
from cccd.surface.outlines import lofted_outlines
from cccd.surface.ring_graph import DOWN, UP
from cccd.surface.rings import Ring
from cccd.surface.stack import interpolate_slices


def stack_of(curves, source="splines"):
    outlines = lofted_outlines(curves, None, SETTINGS.model_copy(update={"source": source}))
    return interpolate_slices(outlines, SETTINGS)


def tubes_of(curves, source="splines"):
    return match_contours(stack_of(curves, source), SETTINGS.matching).tubes


def polygon(section):
    return shapely.Polygon(section.points).buffer(0)


def assert_sound(tube):
    heights = [section.z for section in tube.sections]
    assert np.all(np.diff(heights) > 0)
    for section in tube.sections:
        # simple but for pixels that touch at a corner, and counter-clockwise
        assert polygon(section).area == pytest.approx(signed_area(section.points))


def test_a_cylinder_is_one_tube_with_two_rounded_ends():
    curves = drawn({k: [ellipse(9, 9)] for k in range(5, 25)}, 30)
    stack = stack_of(curves)
    (tube,) = match_contours(stack, SETTINGS.matching).tubes
    assert_sound(tube)
    assert tube.ends == ("cap", "cap")
    assert (tube.hole, tube.depth) == (False, 0)
    on_slices = [section for section in tube.sections if 5 <= section.z <= 24]
    assert len(on_slices) == 20
    assert np.array([section.area for section in on_slices]) == pytest.approx(np.pi * 81, rel=4e-3)
    low, high = tube.poles
    centre = 30 - stack.origin
    assert low[:2] == pytest.approx(centre, abs=0.05)
    assert high[:2] == pytest.approx(centre, abs=0.05)
    # Rounded over almost a slice: half of that volume is what the last slices stand for.
    assert (low[2], high[2]) == pytest.approx((5 - 0.95, 24 + 0.95))
    assert stack.volume == pytest.approx(np.pi * 81 * 20, rel=4e-3)


def test_a_cylinder_through_the_whole_scan_has_planar_ends_half_a_slice_beyond():
    (tube,) = tubes_of(drawn({k: [ellipse(9, 9)] for k in range(12)}, 12, (1.0, 1.0, 2.0)))
    assert_sound(tube)
    assert tube.ends == ("cut", "cut")
    assert tube.poles == (None, None)
    assert (tube.sections[0].z, tube.sections[-1].z) == (-1, 23)
    assert tube.sections[-1].area == pytest.approx(np.pi * 81, rel=4e-3)


def test_a_fork_is_a_trunk_and_a_branch_that_reaches_into_it():
    stack = stack_of(curves_of(fork()))
    tubes = match_contours(stack, SETTINGS.matching).tubes
    trunk, branch = sorted(tubes, key=lambda tube: -len(tube.sections))
    assert_sound(trunk)
    assert_sound(branch)
    assert (trunk.ends, branch.ends) == (("cap", "cap"), ("cap", "joined"))
    assert branch.poles[1] is None
    # On every level the two are the organ, no more, no less: they overlap where it is one outline.
    (run,) = stack.runs
    for level, rings in enumerate(run.rings):
        z = run.fields[level].z
        here = [polygon(s) for tube in (trunk, branch) for s in tube.sections if s.z == z]
        organ = shapely.union_all([shapely.Polygon(ring.points) for ring in rings])
        both = shapely.union_all(here)
        assert both.symmetric_difference(organ).area < 0.02 * organ.area
        if len(rings) == 1 and len(here) == 2:
            assert here[0].intersection(here[1]).area > 0
    # The branch narrows inside the trunk, which holds nearly all of it in the end.
    inside = [section for section in branch.sections if section.z >= 18]
    assert len(inside) >= 2
    assert np.all(np.diff([section.area for section in inside]) < 0)
    (around,) = [polygon(section) for section in trunk.sections if section.z == inside[-1].z]
    assert polygon(inside[-1]).difference(around).area < 0.05 * inside[-1].area


def test_one_branch_holds_nothing_of_a_trunk_that_leaves_nothing_to_it():
    """Without another ring before the junction there is nothing to split: the tube runs straight on."""
    curves = drawn({k: [ellipse(12 if k > 8 else 6, 9)] for k in range(3, 18)}, 22)
    (tube,) = tubes_of(curves)
    assert tube.ends == ("cap", "cap")


def test_a_torus_that_stands_upright_is_two_tubes_and_one_handle():
    x, y, z = grid(60, 40, 50)
    curves = curves_of(np.hypot(np.hypot(x - 30, z - 25) - 14, y - 20) <= 5)
    tubes = tubes_of(curves)
    for tube in tubes:
        assert_sound(tube)
    assert sorted(tube.ends for tube in tubes) == [("cap", "cap"), ("joined", "joined")]
    faces = loft_surface(curves, SETTINGS).faces
    assert len(np.unique(faces)) - 1.5 * len(faces) + len(faces) == 0


def test_a_blind_bore_is_a_hole_that_opens_at_the_top():
    x, y, z = grid(40, 40, 30)
    radius = np.hypot(x - 20, y - 20)
    mask = (radius <= 15) & (z >= 4) & (z < 25) & ~((radius <= 6) & (z >= 10))
    body, bore = sorted(tubes_of(curves_of(mask)), key=lambda tube: tube.hole)
    assert (body.ends, bore.ends) == (("cap", "cap"), ("cap", "opens"))
    assert (bore.hole, bore.depth) == (True, 1)
    assert bore.sections[-1].z > body.poles[1][2]  # it reaches through the cap


def test_a_hole_that_a_slit_opens_ends_outside():
    """Slices 5-14 show a ring, slices 15-24 a C: the hole is open to the side from there on."""
    x, y, z = grid(50, 50, 30)
    radius = np.hypot(x - 25, y - 25)
    mask = (radius <= 18) & (radius >= 8) & (z >= 5) & (z < 25)
    mask &= ~((z >= 15) & (x > 25) & (np.abs(y - 25) <= 5))
    tubes = tubes_of(curves_of(mask), "polygons")  # splines of two slices leave slivers between them
    body, hole = sorted(tubes, key=lambda tube: tube.hole)
    assert hole.ends[1] == "opens"
    last = hole.sections[-1]
    assert last.z == 15  # on the first slice of the C, in its mouth
    (solid,) = [polygon(section) for section in body.sections if section.z == 15]
    assert polygon(last).intersection(solid).area < 0.01 * last.area
    assert last.area == pytest.approx(np.pi * 8**2, rel=0.1)


def test_a_closed_cavity_has_two_caps():
    outside, inside = sorted(tubes_of(curves_of(ball(radius=22) & ~ball(radius=11))), key=lambda t: t.hole)
    assert outside.ends == inside.ends == ("cap", "cap")
    assert inside.depth == 1


def test_specks_are_left_out_and_counted_unless_they_are_all_there_is():
    mask = ball()
    mask[2:4, 2:4, 30] = True
    matched = match_contours(stack_of(curves_of(mask)), SETTINGS.matching)
    assert (len(matched.tubes), matched.left_out) == (1, [4.0])
    mask[:, 4:] = False
    matched = match_contours(stack_of(curves_of(mask)), SETTINGS.matching)
    assert (len(matched.tubes), matched.left_out) == (1, [])


def test_missing_slices_end_a_run():
    there = [*range(4, 10), *range(12, 18), *range(25, 30)]
    stack = stack_of(drawn({k: [ellipse(9, 9)] for k in there}, 34))
    assert [(run.fields[0].z, run.fields[-1].z) for run in stack.runs] == [(4, 17), (25, 29)]
    assert len(match_contours(stack, SETTINGS.matching).tubes) == 2


def ring_around(points) -> Ring:
    none = np.zeros((1, 1), np.uint8)
    return Ring(0, 5.0, points, False, shapely.Polygon(points).area, 5, 0, none, np.zeros(2, np.int64))


@pytest.mark.parametrize(("way", "direction"), [(DOWN, -1), (UP, 1)])
def test_a_round_end_closes_as_a_paraboloid(way, direction):
    sections, pole = rounded_cap(ring_around(ellipse(8, 8)), way, 3.0, 0.7)
    assert pole == pytest.approx([30, 30, 5 + 3 * direction], abs=1e-6)
    for section in sections:
        radius = np.hypot(*(section.points - 30).T)
        assert radius == pytest.approx(8 * np.sqrt(1 - abs(section.z - 5) / 3), rel=1e-6)
        assert section.area == pytest.approx(np.pi * radius.mean() ** 2, rel=1e-3)


def test_a_bent_end_gets_a_planar_cap_with_a_rounded_rim():
    outer, inner = shapely.Point(30, 30).buffer(12), shapely.Point(30, 30).buffer(7)
    half = shapely.box(10, 28, 50, 50)
    bent = np.array(outer.difference(inner).intersection(half).exterior.coords)[:-1]
    bent = bent if shapely.LinearRing(bent).is_ccw else bent[::-1]
    ring = ring_around(bent)
    sections, pole = rounded_cap(ring, UP, 2.0, 0.7)
    assert pole is None
    assert sections[-1].z == pytest.approx(6)
    assert np.all(np.diff([ring.area, *(section.area for section in sections)]) < 0)
    whole = shapely.Polygon(bent).buffer(1e-9)
    assert all(whole.contains(polygon(section)) for section in sections)
