import numpy as np
import pytest

from cccd.contours import trace_stack
from cccd.curves.describe import describe_curves
from cccd.curves.fitting import fit_splines
from cccd.geometry.arrays import concatenate_ragged
from cccd.settings.curves import CurveSettings
from cccd_workflow.curve_measures import area_scores, bytes_per_slice, distances, measure_curves

SETTINGS = CurveSettings()


def square(side, i=0.0, j=0.0):
    return np.array([(i, j), (i + side, j), (i + side, j + side), (i, j + side)], float)


def test_dice_of_areas_of_shifted_squares_and_of_holes(curves_of):
    first = curves_of(square(10), square(10), square(20), square(10, 5, 5)[::-1], slices=[0, 1, 2, 2])
    other = curves_of(square(10, 0, 5), square(10), square(20), slices=[0, 1, 2])
    assert area_scores(first, other)[0] == pytest.approx([0.5, 1, 2 * 300 / 700])
    missing = curves_of(square(10), slices=[1])
    assert area_scores(first, missing)[0] == pytest.approx([0, 1, 0])


def test_distances_are_to_the_curve_of_the_same_number(curves_of):
    lines = curves_of(square(10), square(10, 100, 100))
    points, offsets = concatenate_ragged([np.array([(5, 1), (12, 14)]), np.array([(0.0, 0.0)])])
    assert distances(points, offsets, lines) == pytest.approx([1, np.hypot(2, 4), np.hypot(100, 100)])


def test_measures_of_a_perfect_and_of_a_fitted_description(blob):
    curves = blob(4)[1]
    measured = measure_curves(curves, fit_splines(curves, CurveSettings(tolerance_px=0.5)))
    assert measured["slices"] == 2
    assert measured["boundary_points"] == len(curves.points)
    assert measured["control_point_share"] == pytest.approx(measured["control_points"] / len(curves.points))
    assert 0.995 < measured["dice_p5"] <= measured["dice_median"] < 1
    assert measured["raster_dice_median"] < measured["dice_median"]  # half of the centres on the border
    assert measured["area_kept"] == pytest.approx(1, abs=1e-3)
    exact = measure_curves(curves, fit_splines(curves, CurveSettings(tolerance_px=0.05)))
    assert exact["dice_median"] > 0.9995
    assert exact["distance_max_px"] < 0.1
    assert exact["control_points"] > 5 * measured["control_points"]


def test_bytes_are_what_the_formats_need(curves_of, blob):
    curves = blob(4)[1]
    splines = fit_splines(curves, CurveSettings(max_control_points=20))
    sizes = bytes_per_slice(curves, splines)
    links = np.diff(curves.offsets)
    assert sizes["spline"].tolist() == [4 + 4 + 20 * 8 + 21 * 4] * 2
    assert sizes["chain_code"] == pytest.approx(4 + 8 + np.ceil(3 * links / 8))
    assert np.all(sizes["png"] < sizes["raw"])
    assert np.all(sizes["spline_16_bit"] < sizes["spline"])


@pytest.mark.parametrize("method", ["auto", "corners"])
def test_describing_curves_gives_all_parts(blob, method):
    curves = blob(2)[1]
    fitted = describe_curves(curves, CurveSettings(method=method))
    assert fitted.codes.shape == (len(curves.points),)
    assert fitted.corner_offsets[-1] == len(fitted.corners) == fitted.report["corners"]
    assert fitted.report["control_points"] == len(fitted.splines.control_points)
    assert fitted.report["chain_coded"]
    if method == "corners":
        assert np.array_equal(fitted.splines.control_points, fitted.corners)


def test_drawn_contours_have_splines_but_no_chain_codes(curves_of):
    angle = np.linspace(0, 2 * np.pi, 80, endpoint=False)
    ellipse = 100 + np.column_stack([50 * np.cos(angle), 30 * np.sin(angle)])
    fitted = describe_curves(curves_of(ellipse, slices=[3]), SETTINGS)
    assert len(fitted.codes) == 0
    assert not fitted.report["chain_coded"]
    drawn = fitted.splines.sample(4)
    assert np.hypot(*((drawn.points - 100) / (50, 30)).T) == pytest.approx(1, abs=0.02)


def test_nothing_in_nothing_out(frame):
    nothing = trace_stack(np.zeros((1, 5, 5), bool), (0, 0, 0), frame)
    fitted = describe_curves(nothing, SETTINGS)
    assert len(fitted.codes) == len(fitted.corners) == len(fitted.splines) == fitted.report["curves"] == 0
    assert measure_curves(nothing, fitted.splines)["curves"] == 0
