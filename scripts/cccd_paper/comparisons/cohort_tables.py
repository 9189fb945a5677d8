"""Tables over the cohort out of ``metrics.json``, and the rows that a figure shows."""

from __future__ import annotations

import pandas as pd

from cccd_paper.comparisons.paper_k import BEST, FIGURE_11
from cccd_workflow.report.summary import Cohort


def at_best(rows: pd.DataFrame) -> pd.DataFrame:
    """Rows of a table of surfaces, one per method: of tuned ones those of the smallest ASSD."""
    if "chosen" not in rows:
        return rows
    return rows[rows["chosen"].fillna(BEST).str.contains(BEST)]


def figure_11_rows(corners: pd.DataFrame) -> pd.DataFrame:
    """Rows of the series that Figure 11 shows, ``method`` naming the series: what is drawn and spoken of.

    The fused detectors on the mask with the parameters of Table 2 and, where they are others, of Figure 9,
    their corners along a short tour; and CCCD for four k.
    """
    fused = corners[
        (corners["order"] == "tour")
        & (corners["image"] == "mask")
        & corners["parameters"].isin(["paper, Table 2", "paper, Figure 9"])
    ]
    alike = fused.groupby("detector")["values"].transform("nunique") == 1
    fused = fused[~alike | (fused["parameters"] == "paper, Table 2")]
    named = fused["method"] + ", " + fused["parameters"].str.removeprefix("paper, ").where(~alike, "defaults")
    fused = fused.assign(method=named)
    own = corners[(corners["detector"] == "cccd") & corners["parameters"].isin(FIGURE_11)]
    return pd.concat([fused, own.assign(method="CCCD, " + own["parameters"])])


def shapes(cohort: Cohort) -> pd.DataFrame:
    """Bodies, genus and volume of every surface that has a truth, beside the true ones."""
    columns = ["genus", "genus_true", "volume_ml", "volume_bias", "assd_mm"]
    parts = ["bodies", "cavities"]
    return pd.DataFrame(
        [
            {
                "case": metrics["case"],
                "organ": metrics["organ"],
                "slices": metrics["curves"]["slices"],
                **{name: metrics["surface"][name] for name in parts if name in metrics["surface"]},
                **{name: metrics["surface"].get(name) for name in columns},
            }
            for metrics in cohort.metrics
            if "genus_true" in metrics["surface"]
        ]
    )


def compactness(cohort: Cohort) -> pd.DataFrame:
    """Bytes per slice of every way to keep a structure's contours; the paper: 19.2 KB to 1.03 KB."""
    return pd.DataFrame(
        [
            {
                "case": metrics["case"],
                "organ": metrics["organ"],
                **metrics["curves"].get("bytes_per_slice", {}),
            }
            for metrics in cohort.metrics
        ]
    )


def ordering(cohort: Cohort) -> pd.DataFrame:
    """Say how each structure came by its contours, and where the ordering of its boundary pixels got stuck.

    Of a traced mask it is the network's ordering beside the tracing, where the run uses a network.
    """
    compared = cohort.rows("ordering").rename(
        columns={
            "dice": "GNN against exact tracing, Dice",
            "dice_decided": "the same, slices decided by the GNN",
        }
    )
    beside = compared.set_index(["case", "organ"]).to_dict("index")
    rows = []
    for metrics in cohort.metrics:
        key = metrics["case"], metrics["organ"]
        counted = metrics.get("ordering", {})
        row = {name: value for name, value in counted.items() if isinstance(value, (int, float, str))}
        row |= beside.get(key, {})
        if row:
            rows.append({"case": key[0], "organ": key[1], **row})
    return pd.DataFrame(rows)
