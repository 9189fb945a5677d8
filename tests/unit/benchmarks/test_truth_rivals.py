"""Rivals of the exact-truth benchmark lie where the mask is, and are chosen as the tables say."""

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation
from support import ROOT
from truth_bodies import TURN_DEG, analytic_body, sample_stack
from truth_measures import Target, compare, open_edges, wrong_voxels
from truth_rivals import (
    BANDS,
    DISTANCES,
    EDGES,
    ROUNDS,
    SLICER_EDGES,
    SLICER_NETS,
    by_niimath,
    by_slicer,
    by_windowed_sinc,
    has_niimath,
)
from truth_tables import fill_page, page_tables, summary, thin_page

TURN = Rotation.from_euler("xyz", TURN_DEG, degrees=True)


@pytest.fixture(scope="module")
def body():
    return analytic_body("ellipsoid", TURN)


@pytest.mark.parametrize("ratio", [1, 3])
def test_every_rival_is_near_the_truth(body, ratio):
    mask, affine = sample_stack(body, ratio)
    truth = Target(body.truth)
    made = [*by_windowed_sinc(mask, affine), *by_slicer(mask, affine)]
    assert [one.method for one in made if one.fixed] == [EDGES, DISTANCES, SLICER_EDGES, SLICER_NETS]
    assert len(made) == 2 * len(BANDS) * len(ROUNDS) + 2
    for one in made:
        assert compare(one.mesh, truth, 2000)["assd_mm"] < 0.1 * (1 + ratio)
        assert open_edges(one.mesh) == 0
        assert wrong_voxels(one.mesh, mask, affine)[0] == 0
        assert one.seconds > 0


def test_rivals_follow_an_oblique_affine(body):
    mask, affine = sample_stack(body, 2)
    move = np.eye(4)
    move[:3, :3] = Rotation.from_euler("xyz", (40, 10, -20), degrees=True).as_matrix() * (1, -1, 1)
    move[:3, 3] = 5, 6, 7
    straight = [*by_windowed_sinc(mask, affine), *by_slicer(mask, affine)]
    moved = [*by_windowed_sinc(mask, move @ affine), *by_slicer(mask, move @ affine)]
    for one, other in zip(straight, moved, strict=True):
        assert np.allclose(one.mesh.vertices @ move[:3, :3].T + move[:3, 3], other.mesh.vertices, atol=1e-3)


@pytest.mark.skipif(not has_niimath(), reason="niimath is not on the PATH")
def test_niimath_lies_where_the_mask_is(body):
    mask, affine = sample_stack(body, 2)
    (made,) = by_niimath(mask, affine)
    assert compare(made.mesh, Target(body.truth), 2000)["assd_mm"] < 0.3


def stack(body, slices, **assd):
    """Rows of a stack: a distance for each choice, and figures that are the same in all."""
    alike = {"group": "analytic", "body": body, "slices": slices, "euler": 2, "euler_true": 2}
    alike |= {"hd95_mm": 0.2, "farthest_mm": 0.5, "normals_90_deg": 5.0, "bending_per_mm": 0.1}
    alike |= {"wrong_voxels": 0, "farthest_wrong_px": 0.1, "cpu_seconds": 1.0}
    methods = {"ours": "CCCD", "slicer": SLICER_EDGES}
    choices = {"fixed": "fixed", "best": "best of grid"}
    rows = []
    for number, (name, value) in enumerate(assd.items()):
        own = {"method": methods.get(name, EDGES), "choice": choices.get(name, "default")}
        own |= {"assd_mm": value, "normals_median_deg": 2.0 + number}
        own |= {"assd_to_fixed": value / assd["fixed"], "assd_to_best": value / assd["best"]}
        rows.append(alike | own)
    return rows


def test_the_summary_averages_ratios():
    rows = stack("a", 1, ours=0.09, fixed=0.1, best=0.08, slicer=0.18)
    rows += stack("b", 1, ours=0.11, fixed=0.1, best=0.1, slicer=0.11)
    found = summary(pd.DataFrame(rows)).set_index("rival")
    assert found.loc["fixed setting", "ASSD"] == pytest.approx(1.0)
    assert found.loc["fixed setting", "worst ASSD"] == pytest.approx(1.1)
    assert found.loc["best of grid", "ASSD"] == pytest.approx((0.09 / 0.08 + 1.1) / 2)
    assert found.loc[SLICER_EDGES, "ASSD"] == pytest.approx(0.75)
    assert found.loc["fixed setting", "normals"] == pytest.approx(2 / 3)


def test_the_page_gets_its_tables():
    rows = stack("a", 1, ours=0.09, fixed=0.1, best=0.08, slicer=0.18)
    rows += [row for row in stack("b", 3, ours=1, fixed=1, best=1) if row["method"] != "CCCD"]
    text = page_tables(pd.DataFrame(rows))
    assert "| a | 1:1 | 0.090 | 0.20 | 0.50 | 2.0, 5.0 | 0.100 | 2, 2 | 0, 0.10 | 1.0 | 0.90, 1.12 |" in text
    assert "| b | 1:3 | no surface |" in text
    table = [line.count("|") for line in text.splitlines() if "1:" in line]
    assert set(table) == {8, 12}


def test_the_page_of_thin_masks_leaves_out_what_is_not_known():
    rows = [{"mask": "shell", "voxels": 5034, "wrong_voxels": 12, "farthest_wrong_px": np.nan}]
    figures = dict.fromkeys(("euler", "open_edges", "cpu_seconds"), np.nan)
    assert (
        thin_page(pd.DataFrame([rows[0] | figures])).splitlines()[2] == "| shell | 5,034 | 12 |  |  |  |  |"
    )


def test_a_page_without_the_block_is_refused():
    assert fill_page("a <!-- begin X --> old <!-- end X --> b", "X", "new").split() == (
        ["a", "<!--", "begin", "X", "-->", "new", "<!--", "end", "X", "-->", "b"]
    )
    with pytest.raises(ValueError, match="no block Y"):
        fill_page("a <!-- begin X --> old <!-- end X --> b", "Y", "new")


def test_the_page_has_both_blocks():
    page = (ROOT / "docs/exact_truth.md").read_text(encoding="utf-8")
    assert fill_page(fill_page(page, "bodies", "x"), "thin masks", "y").count("<!--") == 4
