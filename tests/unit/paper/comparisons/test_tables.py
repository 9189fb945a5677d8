import io

import numpy as np
import pandas as pd
import pytest
from support.known_curves import bean
from support.shapes import drawn

from cccd.containers import Frame, Structure
from cccd.contours import trace_contours
from cccd.geometry.raster import rasterise
from cccd_junctions.ordering import order_boundaries
from cccd_paper.comparisons import published
from cccd_paper.comparisons.active_contour_comparison import active_contour_figures, compare_active_contour
from cccd_paper.comparisons.baselines.corner_detectors import CORNER_DETECTORS
from cccd_paper.comparisons.baselines.reconstructions import RECONSTRUCTIONS
from cccd_paper.comparisons.cohort_tables import figure_11_rows
from cccd_paper.comparisons.corner_comparison import compare_corners, corner_figures, search
from cccd_paper.comparisons.paper_k import CCCD
from cccd_paper.comparisons.paper_tables import segmenters
from cccd_paper.comparisons.parameters import GRID
from cccd_paper.comparisons.reconstruction_comparison import (
    ALONG_PIXELS,
    DENSE,
    GIVEN_ORDER,
    HARRIS,
    POINTS,
    compare_reconstruction,
    reconstruction_figures,
)
from cccd_paper.comparisons.samples import choose_slices, to_bytes
from cccd_paper.settings import ComparisonSettings, SliceChoice
from cccd_workflow.report.registry import comparisons, items
from cccd_workflow.report.summary import Cohort, build_tables

SLICES = ComparisonSettings(corners={"n_slices": 2}).corners


def make_structure(with_image: bool) -> Structure:
    """Seven slices of a bean that grows, stacked along the middle axis of a grid that is not cubic."""
    growth = 0.55 + 0.08 * np.arange(7)
    outlines = [scale * (bean(200) - (60, 70)) + (60, 70) for scale in growth]
    mask = np.stack([rasterise([outline], (0, 0), (125, 140)) for outline in outlines])
    rng = np.random.default_rng(5)
    image = np.where(mask, 100.0, 20.0) + rng.normal(0, 4, mask.shape)
    return Structure(
        case="made",
        organ="bean",
        frame=Frame(np.diag([1.0, 3.0, 1.0, 1.0]), 1, (140, 30, 160)),
        origin=np.array([4, 11, 6]),
        image=np.moveaxis(image, 0, 1).astype(np.float32) if with_image else None,
        mask=np.moveaxis(mask, 0, 1),
    )


def as_read_back(table: pd.DataFrame) -> pd.DataFrame:
    """What the table is after its way through a CSV file."""
    return pd.read_csv(io.StringIO(table.to_csv(index=False, float_format="%.6g")))


ORDERERS = [lambda pixels: order_boundaries(pixels, None)[0]]


def compare_all(structure, curves, orderers=()) -> list[pd.DataFrame]:
    """The rows of the three comparisons that the paper's tables stand on, with the decoder for a network."""
    tables = (
        compare_corners(structure, curves, SLICES),
        compare_reconstruction(structure, curves, SLICES, 7, orderers),
        compare_active_contour(structure, curves, 7),
    )
    return [as_read_back(table) for table in tables]


def as_cohort(rows) -> Cohort:
    return Cohort(dict(zip(("corners", "reconstruction", "active_contour"), rows, strict=True)))


@pytest.fixture(scope="module")
def structure():
    return make_structure(with_image=True)


@pytest.fixture(scope="module")
def rows(structure):
    curves = trace_contours(structure)
    return compare_all(structure, curves, ORDERERS)


@pytest.fixture(scope="module")
def tables(rows):
    return build_tables(as_cohort(rows))


def test_slices_are_spread_and_long_enough(structure):
    curves = trace_contours(structure)
    assert [sample.k for sample in choose_slices(structure, curves, 3, 30)] == [12, 14, 16]
    assert [sample.k for sample in choose_slices(structure, curves, 99, 30)] == list(range(11, 18))
    longest = np.diff(curves.offsets).max()
    assert [sample.k for sample in choose_slices(structure, curves, 9, longest + 1)] == [17]


def test_a_sample_shows_its_slice(structure):
    sample = choose_slices(structure, trace_contours(structure), 1, 30)[0]
    stack = structure.stack("mask")[sample.k - structure.stack_origin[0]]
    low = sample.origin - structure.stack_origin[1:]
    seen = np.argwhere(sample.region) + low
    np.testing.assert_array_equal(seen, np.argwhere(stack))
    np.testing.assert_array_equal(sample.images["mask"] > 0, sample.region)
    drawn = np.argwhere(sample.images["outline"]) + sample.origin
    assert {tuple(pixel) for pixel in drawn} == {tuple(pixel) for pixel in sample.boundary.astype(int)}
    grey = sample.images["grey"]
    assert grey[sample.region].mean() > grey[~sample.region].mean() + 30


def test_the_window_is_the_organs():
    stack = np.full((2, 20, 20), -1000.0)
    organ = np.zeros(stack.shape, bool)
    organ[:, 5:15, 5:15] = True
    stack[organ] = np.linspace(80, 120, organ.sum())
    grey = to_bytes(stack, organ)
    assert grey[~organ].max() == 0
    assert np.median(grey[organ]) == pytest.approx(127.5, abs=1)
    stack[0, 5, 5] = np.nan
    assert to_bytes(stack, organ)[0, 5, 5] == 0


def test_every_method_is_in_every_table(rows):
    corners, reconstruction, _ = rows
    assert set(corners["detector"]) == {*CORNER_DETECTORS, "cccd"}
    assert set(corners["image"]) == {"mask", "outline", "grey", "chain code"}
    titles = {method.title for method in RECONSTRUCTIONS.values()} | {CCCD}
    for _, group in reconstruction.groupby(["slice", "points"]):
        assert set(group["method"]) == titles


def test_cccd_closes_every_curve_near_the_truth(rows):
    own = rows[1][rows[1]["method"] == CCCD]
    assert set(own.loc[own["points"] == DENSE, "given"]) == {POINTS, GIVEN_ORDER}
    assert set(own.loc[own["points"] == HARRIS, "given"]) == {POINTS, GIVEN_ORDER, ALONG_PIXELS}
    assert (own.loc[own["points"] == DENSE, "dice"] > 0.99).all()
    assert own.loc[(own["given"] != POINTS) | (own["points"] == DENSE), "closed"].all()


def test_the_order_found_on_an_outline_is_the_order_given(rows):
    own = rows[1][rows[1]["method"] == CCCD].set_index(["slice", "points"]).drop(columns="ms")
    found, given = (own[own["given"] == way].drop(columns="given") for way in (ALONG_PIXELS, GIVEN_ORDER))
    pd.testing.assert_frame_equal(found, given.loc[found.index])


def test_a_rank_is_among_those_that_see_the_points_alone(tables):
    table = tables["table4_reconstruction"]
    for _, group in table.groupby(["organ", "points"]):
        alone = group[group["given"] == POINTS]
        assert alone["rank"].min() == 1
        assert alone["rank"].max() <= len(alone)


def test_the_truth_encloses_itself(rows):
    dense = rows[1][rows[1]["points"] == DENSE]
    assert dense.loc[dense["method"] == RECONSTRUCTIONS["tour"].title, "dice"].eq(1).all()


def test_ours_stand_beside_the_papers(tables):
    first = tables["table1_corners"]
    harris = first[first["method"] == CORNER_DETECTORS["harris"].title].set_index(["image", "parameters"])
    assert harris.loc[("grey", "paper, Table 2"), "paper_corners"] == 716
    second = tables["table2_fuse"].set_index(["method", "parameters"])
    assert second.loc[(CCCD, "k = 3"), "paper_dice_percent"] == 98.49
    assert (
        second.loc[(CORNER_DETECTORS["fast"].title, "paper, Table 2"), "paper_dice_percent"] == 88.4
    ).all()
    third = tables["table3_segmentation"]
    quoted = third["note"] == published.OTHER_DATA
    assert set(third.loc[quoted, "method"]) == set(published.NETWORKS["method"])
    assert third.loc[quoted, "dice_percent"].isna().all()
    assert third.loc[~quoted, "dice_percent"].notna().all()
    fourth = tables["table4_reconstruction"].set_index(["points", "method"])
    assert fourth.loc[(HARRIS, "NN-Crust"), "paper_disconnected"] == 12
    assert fourth.loc[(DENSE, CCCD), "paper_connected"].isna().all()
    fifth = tables["table5_times"].set_index(["method", "parameters"])
    assert fifth.loc[("Crawl", HARRIS), "paper_curve_s"] == 6.87
    assert np.isnan(fifth.loc[("Crawl", DENSE), "paper_curve_s"])  # the paper links Harris corners
    assert fifth.loc[(CCCD, DENSE), "curve_ms"] > 0
    assert fifth["corner_ms"].fillna(fifth["curve_ms"]).notna().all()


def test_a_detector_whose_two_sets_are_one_is_one_series_of_figure_11(rows):
    series = set(figure_11_rows(rows[0])["method"])
    assert {"FUSE3 (FAST), defaults", "FUSE2 (Shi-Tomasi), Table 2", "FUSE2 (Shi-Tomasi), Figure 9"} < series
    assert not {"FUSE3 (FAST), Table 2", "FUSE3 (FAST), Figure 9"} & series


@pytest.mark.parametrize(("organ", "expected"), [("liver", [96.5, None, 98.49]), ("lungs", [None] * 3)])
def test_figures_of_other_data_stand_beside_no_row(organ, expected):
    methods = ["H-DenseUNet", "nnU-Net (plain)", f"{CCCD}, k = 3"]
    table = pd.DataFrame({"case": "a", "organ": organ, "method": methods, "given": "the image"})
    quoted = segmenters(Cohort({"segmenters": table}))["paper_dice_percent"]
    assert quoted.astype(object).where(quoted.notna(), None).tolist() == expected


def test_figures_11_and_15_are_tables_too(tables, rows):
    rates = tables["figure11_rates"].set_index(["image", "method", "parameters"])
    shares = rates[["TP rate", "FP rate", "TN rate", "FN rate"]]
    assert len(rates) == len(rates.index.unique())
    assert {"mask", "outline", "grey", "chain code"} == set(rates.index.get_level_values("image"))
    assert (rates["ACC"] + rates["MC"]).round(4).eq(1).all()
    assert (shares <= 1).all(axis=None)
    snakes = tables["figure15_snakes"]
    assert (snakes["least"] <= snakes["dice_percent"]).all()
    assert (snakes["dice_percent"] <= snakes["most"]).all()
    assert set(snakes["setting"]) == set(rows[2]["setting"])


def test_false_shares_count_all_corners(tables, rows):
    corners = rows[0]
    chosen = corners[
        (corners["detector"] == "harris") & (corners["image"] == "grey") & (corners["order"] == "chain")
    ]
    chosen = chosen[chosen["parameters"] == "paper, Table 2"]
    expected = 100 * (1 - chosen["on_boundary"].sum() / chosen["corners"].sum())
    table = tables["table1_corners"].set_index(["method", "image", "parameters"])
    row = (CORNER_DETECTORS["harris"].title, "grey", "paper, Table 2")
    assert table.loc[row, "false_percent"] == pytest.approx(expected)


def test_the_first_rank_goes_to_the_best(tables):
    for _, group in tables["table4_reconstruction"].groupby(["organ", "points"]):
        leader = group[group["rank"] == 1].iloc[0]
        assert leader["closed_percent"] == group["closed_percent"].max()


def test_a_mask_without_image_is_enough():
    structure = make_structure(with_image=False)
    curves = trace_contours(structure)
    rows = compare_all(structure, curves)
    assert set(rows[0]["image"]) == {"mask", "outline", "chain code"}
    assert set(rows[1].loc[rows[1]["method"] == CCCD, "given"]) == {GIVEN_ORDER}


def test_the_same_seed_gives_the_same_rows(structure, rows):
    again = compare_reconstruction(structure, trace_contours(structure), SLICES, 7, ORDERERS)
    again = as_read_back(again)
    pd.testing.assert_frame_equal(again.drop(columns="ms"), rows[1].drop(columns="ms"))


def test_search_ranks_the_eligible_first(structure, monkeypatch):
    monkeypatch.setitem(GRID, "harris", {"block": (2,), "aperture": (3,), "k": (0.04,), "threshold": (0.01,)})
    monkeypatch.setitem(GRID, "susan", {"radius": (0, 2)})
    scores = search(choose_slices(structure, trace_contours(structure), 1, 30))
    for _, group in scores.groupby(["image", "detector"]):
        eligible = group["eligible"].to_numpy()
        assert (np.diff(eligible.astype(int)) <= 0).all()
        assert (np.diff(group.loc[group["eligible"], "DSC"]) <= 0).all()


def test_figures_hold_every_panel(structure):
    curves = trace_contours(structure)
    links = reconstruction_figures(structure, curves, SLICES, 7)["figure16"]
    assert [panel.title for panel in links.panels] == [
        "Ground truth", "Connect2D", "Crawl", "NN-Crust", "2-opt tour", "CCCD, order given",
    ]  # fmt: skip
    found = reconstruction_figures(structure, curves, SLICES, 7, ORDERERS)["figure16"]
    assert len(found.panels) == len(links.panels) + 2
    fused = corner_figures(structure, curves, SLICES)["figure9"]
    assert len(fused.panels) == 2 * fused.columns == 2 * len(CORNER_DETECTORS)
    assert fused.image.shape == tuple(np.diff(fused.window, axis=0)[0] + 1)
    snakes = active_contour_figures(structure, curves, 7)["figure15"]
    assert len(snakes.panels) == 2 * snakes.columns == 2 * 5


def test_rows_and_tables_have_the_columns_that_the_registry_promises(rows, tables):
    for name, frame in zip(("corners", "reconstruction", "active_contour"), rows, strict=True):
        assert set(comparisons()[name].columns) <= set(frame.columns), name
    for item in items():
        if item.table in tables:
            assert set(item.columns) <= set(tables[item.table].columns), item.table


def test_a_cohort_without_rows_has_empty_tables():
    assert all(frame.empty for frame in build_tables(Cohort({})).values())


def test_corners_of_drawn_contours():
    turn = np.linspace(0, 2 * np.pi, 70, endpoint=False)
    rings = [
        20 + radius * np.column_stack([np.cos(turn), 0.8 * np.sin(turn)]) for radius in (12.3, 13.1, 12.7)
    ]
    curves = drawn(rings, shape=(40, 40, 3), affine=np.diag([1.0, 1.0, 3.0, 1.0]))
    structure = Structure("a", "drawn", curves.frame, np.zeros(3, int), contours=curves)
    settings = SliceChoice(n_slices=1)
    table = compare_corners(structure, curves, settings)
    ours = table[(table["method"] == CCCD) & (table["parameters"] == "automatic")]
    assert (ours["DSC"] > 0.97).all()
