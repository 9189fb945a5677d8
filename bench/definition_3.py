"""Definition 3's three readings on the default cohort's masks: `python bench/definition_3.py`.

`cccd_paper.comparisons.definition_3` has the readings. A row is a reading and a k on one structure: share
of the pixels that are corners, Dice of the splines through them against the mask, how often corners are
found again when the outline is turned, scaled or moved by noise, and the share of the corners whose own
support is 1 as printed. The committed table is docs/measured/definition_3.csv; it takes about two minutes
of one core.
"""

from one_core import ROOT  # isort: skip

import argparse
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from cccd.containers import Curves
from cccd.contours import trace_contours
from cccd.curves.corners import k_cosine
from cccd.geometry.arrays import concatenate_ragged
from cccd.inputs import Request, read_request
from cccd.settings.imports import ImportSettings
from cccd.settings.root import Settings
from cccd_paper.comparisons.corner_measures import SWEEP, measure_corners
from cccd_paper.comparisons.definition_3 import READINGS
from cccd_paper.comparisons.repeatability import repeatability
from cccd_paper.comparisons.samples import choose_slices
from cccd_workflow.cohort import read_cohort

CASES = ("mni152/brain", "phantom/liver", "phantom/lungs")


def structures():
    """The structures, by name."""
    sheet = ROOT / "config" / "cohort.tsv"
    for row in read_cohort(sheet):
        name = f"{row['case']}/{row['organ']}"
        if name in CASES:
            asked = Request.of_row(row, sheet.parent)
            yield name, read_request(asked, ImportSettings(), seed=Settings().seed)


def rows_of(structure) -> list[dict]:
    """A row per reading and k."""
    curves = trace_contours(structure)
    outlines = [sample.curve for sample in choose_slices(structure, curves, 5)]
    points, offsets = concatenate_ragged(outlines)
    few = Curves(points, offsets, np.arange(len(outlines)), np.zeros(len(outlines), bool), curves.frame)
    detectors = {(name, k): partial(reading, k=k) for name, reading in READINGS.items() for k in SWEEP}
    named = {f"{name}|{k}": detect for (name, k), detect in detectors.items()}
    again = repeatability(few, np.random.default_rng(Settings().seed), named)
    again = again.groupby(["detector", "change"])["repeatability"].mean().unstack("change")
    rows = []
    for (name, k), detect in detectors.items():
        corner = detect(curves.points, curves.offsets)
        measured = measure_corners(curves, corner, structure.stack("mask"), structure.stack_origin)
        row = {"reading": name, "k": k, "corners": int(corner.sum())}
        row |= {key: measured[key] for key in ("share", "too_few", "DSC")}
        if name == "as printed":
            row["support_1"] = float((k_cosine(curves.points, curves.offsets, k)[1][corner] == 1).mean())
        rows.append(row | again.loc[f"{name}|{k}"].to_dict())
    return rows


def main() -> None:
    """Measure every structure and write the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--table", type=Path, default=ROOT / "docs" / "measured" / "definition_3.csv")
    table = pd.concat(
        [pd.DataFrame(rows_of(structure)).assign(structure=name) for name, structure in structures()],
        ignore_index=True,
    )
    table = table[["structure", *table.columns.drop("structure")]]
    table.to_csv(parser.parse_args().table, index=False, float_format="%.4g")
    print(table.to_string())


if __name__ == "__main__":
    main()
