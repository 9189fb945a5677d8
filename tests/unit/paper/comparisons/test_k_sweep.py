"""The sweep over k, and the chain-code detectors beside it."""

import numpy as np
import pandas as pd
import pytest
from support.known_curves import bean
from support.shapes import curves_of, drawn, structure_of

from cccd.containers import Frame
from cccd.geometry.polygons import RaggedPolygons
from cccd.geometry.raster import rasterise
from cccd_paper.comparisons.chain_corners import DETECTORS
from cccd_paper.comparisons.k_sweep import OWN, _outline, compare_k, search_chain
from cccd_paper.comparisons.parameters import BEST_OF_GRID, CHAIN_BEST, CHAIN_GRID, LARGEST_SHARE, UNTUNED
from cccd_paper.settings import SliceChoice

KS = (3, 20)


def trace_outline(outline):
    """The pixel chain of one filled outline."""
    return curves_of(rasterise([outline], (0, 0), (140, 140))[:, :, None]).points


@pytest.fixture(scope="module")
def rows():
    """A five-pointed star below a round bean."""
    angle = 2 * np.pi * np.arange(10) / 10
    star = 70 + np.where(np.arange(10) % 2, 25, 60)[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    mask = np.stack([rasterise([outline], (0, 0), (140, 140)) for outline in (star, bean(200))], axis=2)
    structure, curves = structure_of(mask), curves_of(mask)
    return [compare_k(structure, curves, KS, SliceChoice(), seed) for seed in (1, 1, 2)]


def test_every_detector_is_a_row(rows):
    table = rows[0]
    assert set(table["detector"]) == set(DETECTORS)
    own = table[table["criterion"] == OWN]
    others = sorted(set(DETECTORS) - {"k-cosine"})
    for parameters in (UNTUNED, BEST_OF_GRID):
        assert sorted(own.loc[own["parameters"] == parameters, "detector"]) == others
    assert own["k"].isna().all()
    assert table.groupby("criterion")["k"].apply(lambda k: sorted(k.dropna())).to_dict() == {
        "max": list(KS), "min": list(KS), OWN: [],
    }  # fmt: skip


def test_corners_are_few_and_found_again_as_a_share(rows):
    table = rows[0]
    assert table.loc[table["criterion"] != "min", "share"].between(0, 0.5).all()
    assert table[["rotation", "scale", "noise"]].stack().between(0, 1).all()
    untuned = table[table["parameters"] == UNTUNED].set_index("detector")
    own = untuned.loc[["Rosenfeld-Johnston", "Cheng-Hsu"]]
    assert (own["rotation"] > 0.6).all()  # a star's tips and dents stay where they are
    assert (own["corners"] >= 10).all()


def test_the_search_finds_the_parameters_that_describe_the_outlines_best(rows):
    outlines = [bean(200), bean(150)]
    scores = search_chain(
        [trace_outline(outline) for outline in outlines], Frame(np.eye(4), 2, (140, 140, 2))
    )
    assert set(scores["detector"]) == set(CHAIN_GRID) == set(CHAIN_BEST)
    for _, part in scores.groupby("detector"):
        eligible = part[part["eligible"]]
        assert part["eligible"].iloc[0]
        assert eligible["DSC"].iloc[0] == eligible["DSC"].max()
        assert (eligible["share"] <= LARGEST_SHARE).all()
    own = rows[0][rows[0]["criterion"] == OWN].pivot(index="detector", columns="parameters", values="DSC")
    assert (own[BEST_OF_GRID] > own[UNTUNED]).all()


def test_only_the_noise_hangs_on_the_seed(rows):
    first, again, other = (table.drop(columns="ms") for table in rows)
    pd.testing.assert_frame_equal(first, again)
    pd.testing.assert_frame_equal(first.drop(columns="noise"), other.drop(columns="noise"))
    assert not first["noise"].equals(other["noise"])


def test_a_figure_says_which_splines_cross_themselves():
    square = np.array([(20.0, 20), (20, 60), (60, 60), (60, 20)])
    crossed = square[[0, 2, 1, 3]]
    for outline, said in ((square, False), (crossed, True)):
        line = RaggedPolygons.of([outline]).resample(np.array([160]))
        assert _outline(drawn([line.points]), 7).detail.endswith(", crosses itself") is said
