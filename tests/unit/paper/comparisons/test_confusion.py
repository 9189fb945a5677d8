import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cccd.metrics import dice
from cccd_paper.comparisons.confusion import Confusion, confusion


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
