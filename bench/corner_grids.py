"""Corner detectors with every chance: `python bench/corner_grids.py`.

Searches the grids of the detectors on pixels and on the chain code on training phantoms, of a case that no
cohort reports on, and writes two tables into docs/measured. `corner_grids.csv` has the best of each grid,
which stands in `cccd_paper.comparisons.parameters` too; of those as good, one inside the grid.
`equal_points.csv` has the detectors on the default cohort at equal numbers of points
(`equal_points`). It takes about half an hour of one core.
"""

from one_core import ROOT  # isort: skip

import argparse
from collections.abc import Iterator
from pathlib import Path

import pandas as pd
from definition_3 import structures
from equal_points import CHAIN, choose_for_shares, measure_at_shares

from cccd.containers import Frame
from cccd.contours import trace_contours
from cccd.settings.imports import PhantomSettings
from cccd_datasets.phantoms import make_phantom
from cccd_paper.comparisons.corner_comparison import search
from cccd_paper.comparisons.k_sweep import search_chain
from cccd_paper.comparisons.parameters import CHAIN_GRID, GRID, open_edges
from cccd_paper.comparisons.samples import SliceSample, choose_slices

ORGANS, SLICES, SEED = ("liver", "lungs", "kidney"), 4, 152

#: Of the paper's own detector, at equal numbers of points; elsewhere its k are those of the figures.
K_COSINE = {"k-cosine": {"k": (1, 2, 3, 4, 5, 6, 7, 8, 10, 12, 15, 20, 30, 40)}}


def training_samples() -> tuple[list[SliceSample], Frame]:
    """Slices of the training phantoms, and the frame of one of them."""
    samples: list[SliceSample] = []
    for organ in ORGANS:
        phantom = make_phantom(
            "training", organ, PhantomSettings().spacing_mm, seed=SEED, margin_voxels=3, location=""
        )
        samples += choose_slices(phantom, trace_contours(phantom), SLICES)
    return samples, phantom.frame


def searched() -> pd.DataFrame:
    """Every point of every grid, scored on the training slices."""
    samples, frame = training_samples()
    chain = search_chain([sample.curve for sample in samples], frame, CHAIN_GRID | K_COSINE)
    return pd.concat([search(samples), chain.assign(image=CHAIN)], ignore_index=True)


def best_of_grids(scores: pd.DataFrame) -> Iterator[dict]:
    """Yield a row for each image and detector: its best parameters that few enough pixels allow."""
    grids = GRID | CHAIN_GRID
    few = scores[scores["eligible"] & scores["detector"].isin(list(grids))]
    for (image, detector), rows in few.groupby(["image", "detector"]):
        alike = rows[rows["DSC"].round(6) == rows["DSC"].round(6).max()]
        edges = [len(open_edges(str(detector), point)) for point in alike["parameters"]]
        best = alike.assign(edges=edges).sort_values(["edges", "share"], kind="stable").iloc[0]
        values = ", ".join(f"{name} {value}" for name, value in best["parameters"].items())
        row = {"image": image, "detector": detector, "values": values, "as_good": len(alike)}
        yield row | {name: best[name] for name in ("DSC", "share", "found", "edges")}


def main() -> None:
    """Search, measure and write both tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--tables", type=Path, default=ROOT / "docs" / "measured")
    write_tables(searched(), parser.parse_args().tables)


def write_tables(scores: pd.DataFrame, folder: Path) -> None:
    """Write the best of each grid, and the default cohort's Dice at equal numbers of points."""
    best = pd.DataFrame(best_of_grids(scores))
    best.to_csv(folder / "corner_grids.csv", index=False, float_format="%.4g")
    chosen, parts = choose_for_shares(scores), []
    for name, structure in structures():
        curves = trace_contours(structure)
        rows = measure_at_shares(choose_slices(structure, curves, 5), curves.frame, chosen)
        parts.append(rows.assign(structure=name))
    measured = pd.concat(parts, ignore_index=True)
    measured = measured[["structure", *measured.columns.drop("structure")]]
    measured.to_csv(folder / "equal_points.csv", index=False, float_format="%.4g")
    print(best.to_string(), measured.to_string(), sep="\n")


if __name__ == "__main__":
    main()
