import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cccd.curves.corners import k_cosine_corners
from cccd.curves.fitting import corner_splines
from cccd.geometry.raster import dice
from cccd_paper.comparisons.confusion import Confusion, confusion
from cccd_paper.comparisons.corner_measures import measure_corners
from cccd_paper.comparisons.repeatability import repeatability


def sweep(curves, ks, *truth):
    """Measure the splines of each criterion and k (Tables 2 and 3)."""
    return pd.DataFrame(
        {"criterion": criterion, "k": k}
        | measure_corners(curves, k_cosine_corners(curves.points, curves.offsets, k, criterion), *truth)
        for criterion in ("max", "min")
        for k in ks
    )


def test_sweep_has_the_paper_s_shape(blob):
    mask, curves = blob(6, slices=3, waves=0.2)
    table = sweep(curves, (3, 5, 7, 12, 20), mask, (0, 0, 0)).set_index(["criterion", "k"])
    assert len(table) == 10
    sharpest, straightest = table.loc["max"], table.loc["min"]
    for score in ("DSC", "JI", "ACC"):
        assert sharpest[score].loc[[3, 5, 7]].min() > sharpest[score][12] > sharpest[score][20]
        assert straightest[score][20] < sharpest[score][20]  # the minimum collapses earlier
    assert sharpest["corners"].is_monotonic_decreasing
    assert (table["ACC (whole)"] + table["MC (whole)"]).to_numpy() == pytest.approx(1)
    assert (table["PRE"] == table["recall"]).all()

    row = table.loc[("max", 5)]
    corner = k_cosine_corners(curves.points, curves.offsets, 5)
    filled = corner_splines(curves, corner).sample().rasterise((0, 0, 0), mask.shape)
    assert row["DSC (whole)"] == pytest.approx(dice(mask, filled))
    assert row["DSC"] == pytest.approx(np.median(dice(mask, filled, axis=(1, 2))))
    slices_pixels = 3 * 420 * 420  # rates are shares of the source's whole slices
    assert row["TP rate (whole)"] == pytest.approx(np.count_nonzero(mask & filled) / slices_pixels)


def test_sweep_without_a_mask_takes_the_filled_curves(blob):
    mask, curves = blob(6)
    given = sweep(curves, (5,), mask, (0, 0, 0))
    filled = sweep(curves, (5,))
    assert filled["DSC (whole)"].to_numpy() == pytest.approx(given["DSC (whole)"].to_numpy())
    assert filled["ACC (whole)"].to_numpy() == pytest.approx(given["ACC (whole)"].to_numpy())


@pytest.fixture
def star(curves_of):
    """Outline with ten unmistakable corners."""
    angle = np.linspace(0, 2 * np.pi, 10, endpoint=False) + 0.1
    radius = np.where(np.arange(10) % 2, 90, 55)
    return curves_of(150 + radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)]))


def test_repeatability_is_perfect_without_change_and_falls_with_noise(star):
    table = repeatability(star, np.random.default_rng(0), rotations=(0,), scales=(), noises=(0, 2.0))
    table = table.set_index(["detector", "change", "amount"])["repeatability"].unstack(["change", "amount"])
    assert table["rotation", 0].to_numpy() == pytest.approx(1)
    assert table["noise", 0].to_numpy() == pytest.approx(1)
    assert (table["noise", 2.0] < 1).all()


def test_corners_that_are_nowhere_are_not_counted_as_found_again(star):
    nowhere = {"none": lambda points, offsets: np.zeros(len(points), bool)}
    table = repeatability(star, np.random.default_rng(0), nowhere, rotations=(30,), scales=(), noises=())
    assert table["repeatability"].isna().all()


def test_printed_equations_on_hand_counted_pixels():
    truth = np.array([[1, 1, 1, 0], [1, 0, 0, 0]], bool)
    predicted = np.array([[1, 1, 0, 1], [0, 0, 0, 1]], bool)
    counts = confusion(truth, predicted)
    assert (counts.tp, counts.fp, counts.tn, counts.fn) == (2, 2, 2, 2)
    counts = Confusion(tp=30, fp=10, tn=50, fn=20)
    printed = counts.printed
    shares = [30 / 110, 10 / 110, 50 / 110, 20 / 110, 80 / 110, 30 / 110]
    assert list(printed.values()) == pytest.approx([*shares, 30 / 50, 50 / 60, 60 / 90, 30 / 60])
    assert counts.standard["precision"] == pytest.approx(30 / 40)
    assert counts.standard["recall"] == printed["PRE"]  # eq. (18) is the usual recall
    assert counts.standard["false positive rate"] == pytest.approx(1 - printed["SPEC"])


@settings(deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_identities_hold_per_slice_and_in_total(seed):
    rng = np.random.default_rng(seed)
    truth, predicted = rng.random((2, 3, 6, 5)) < rng.random()
    slices = confusion(truth, predicted, axis=(1, 2))
    whole = confusion(truth, predicted)
    assert slices.tp.sum() == whole.tp
    assert slices.tn.sum() == whole.tn == np.count_nonzero(~truth & ~predicted)
    assert whole.fp == np.count_nonzero(~truth & predicted)
    printed = whole.printed
    assert sum(printed[f"{name} rate"] for name in ("TP", "FP", "TN", "FN")) == pytest.approx(1)
    assert printed["ACC"] + printed["MC"] == pytest.approx(1)
    assert printed["JI"] == pytest.approx(printed["DSC"] / (2 - printed["DSC"]))
    assert dice(truth, predicted) == dice(predicted, truth) == printed["DSC"]
    assert confusion(truth, truth).printed["JI"] == 1
    nothing = np.zeros((2, 2), bool)
    assert np.isnan(confusion(nothing, nothing).printed["PRE"])  # undefined
