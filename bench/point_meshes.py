"""Surfaces from points alone, the paper's [3] to [5]: `python bench/point_meshes.py`.

Ball pivoting, alpha shapes and Poisson reconstruction (Open3D, `pip install open3d`; it needs the system's
libusb-1.0) get the pixels of the default cohort's outlines, as the paper's loft does. All are measured
against the phantoms' true surfaces and the brain's mask. The committed table is
docs/measured/point_meshes.csv; it takes about five minutes of one core.
"""

from one_core import ROOT  # isort: skip

import argparse
from pathlib import Path

import pandas as pd
from definition_3 import structures

from cccd.contours import trace_contours
from cccd_paper.comparisons.baselines.surfaces import SURFACES
from cccd_paper.comparisons.timing import timed
from cccd_paper.comparisons.tuning import SAMPLES
from cccd_workflow.surface_measures import Reference, measure_agreement

METHODS = ("ball pivoting", "alpha shape", "Poisson", "paper's loft, eq. (10)", "marching cubes")

COLUMNS = (
    "structure", "method", "closed_manifold", "genus", "dice_3d", "assd_mm", "hd95_mm", "triangles",
    "seconds",
)  # fmt: skip


def main() -> None:
    """Measure every method on every structure, and write the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--table", type=Path, default=ROOT / "docs" / "measured" / "point_meshes.csv")
    arguments, rows = parser.parse_args(), []
    for name, structure in sorted(structures(), key=lambda one: one[1].mask.size):
        curves, reference = trace_contours(structure), Reference.of(structure)
        for method in METHODS:
            mesh, seconds = timed(SURFACES[method].run, structure, curves)
            closed = mesh.is_closed_manifold
            row = {"closed_manifold": closed, "genus": mesh.genus if closed else None}
            row |= {"triangles": len(mesh.faces), "seconds": seconds}
            figures = measure_agreement(mesh, structure, reference, SAMPLES)
            if not closed:  # what it holds is not defined
                del figures["dice_3d"]
            rows.append({"structure": name, "method": method, **row, **figures})
            print(name, method, round(seconds, 1), flush=True)
        table = pd.DataFrame(rows).reindex(columns=list(COLUMNS))  # after each: some take long
        table.to_csv(arguments.table, index=False, float_format="%.4g")
    print(table.to_string())


if __name__ == "__main__":
    main()
