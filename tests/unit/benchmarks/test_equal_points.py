"""Detectors at equal numbers of points."""

import numpy as np
import pandas as pd
from equal_points import CHAIN, choose_for_shares, measure_at_shares
from support.known_curves import bean
from support.shapes import structure_of

from cccd.contours import trace_contours
from cccd.geometry.raster import rasterise
from cccd_paper.comparisons.samples import choose_slices


def scores(*rows):
    columns = ["image", "detector", "parameters", "DSC", "share", "found"]
    return pd.DataFrame(rows, columns=columns)


def test_the_best_within_each_share_is_chosen():
    table = scores(
        (CHAIN, "k-cosine", {"k": 3}, 0.99, 0.35, np.nan),
        (CHAIN, "k-cosine", {"k": 7}, 0.98, 0.15, np.nan),
        (CHAIN, "k-cosine", {"k": 8}, 0.97, 0.12, np.nan),
        ("grey", "fast", {"threshold": 1}, 0.999, 0.1, 3.0),  # three times as many as the outline has pixels
        ("grey", "fast", {"threshold": 9}, 0.9, 0.1, 0.5),
    )
    chosen = choose_for_shares(table, (0.05, 0.2, 0.4)).set_index(["detector", "at_most"])["parameters"]
    assert chosen.to_dict() == {
        ("k-cosine", 0.2): {"k": 7},
        ("k-cosine", 0.4): {"k": 3},
        ("fast", 0.2): {"threshold": 9},
        ("fast", 0.4): {"threshold": 9},
    }


def test_more_points_describe_an_outline_better():
    mask = np.stack([rasterise([bean(200)], (0, 0), (140, 140))] * 2, axis=2)
    structure = structure_of(mask)
    curves = trace_contours(structure)
    samples = choose_slices(structure, curves, 2)
    chosen = pd.DataFrame(
        [
            (CHAIN, "k-cosine", {"k": 3}, 0.4),
            (CHAIN, "k-cosine", {"k": 20}, 0.05),
            ("outline", "fast", {"threshold": 10, "suppress": False}, 0.4),
            ("grey", "fast", {"threshold": 10, "suppress": False}, 0.4),
        ],
        columns=["image", "detector", "parameters", "at_most"],
    )
    rows = measure_at_shares(samples, curves.frame, chosen)
    assert rows["values"][0] == "k 3"
    assert rows["DSC"][0] > 0.985 > rows["DSC"][1]
    assert rows["share"][0] > 3 * rows["share"][1]
    assert rows["DSC"][2] > 0.9
    assert rows.loc[3, ["share", "DSC"]].isna().all()  # there is no grey image
