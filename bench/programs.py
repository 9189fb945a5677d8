"""Ours and the tuned baselines next to programs that people use: niimath, and 3D Slicer's own converters.

    pip install niimath
    python -m venv slicer && slicer/bin/pip install slicer-core
    CCCD_SLICER_PYTHON=slicer/bin/python python bench/programs.py

Both programs are optional: one that is not there has no row, and a line says so. Structures are those of the
default cohort that have a mask, whole and, but for the letters, from every n-th slice. All methods get the
same mask on the same grid and are measured against the same surface. Programs and baselines stand at the
setting with the smallest ASSD of a grid and at the smallest among those as smooth as ours, programs at their
defaults as well. Seconds are the processor's from the mask on. The table goes to docs/programs.csv.
"""

from one_core import ROOT  # isort: skip

import os
import sys

os.environ.setdefault("VTK_SMP_MAX_THREADS", "1")

import pandas as pd
from keep_tables import TABLES

from cccd.contours import trace_contours
from cccd.inputs import Request, read_request
from cccd.settings.imports import ImportSettings
from cccd.settings.root import Settings
from cccd.settings.surface import LoftSettings
from cccd.surface.loft import loft_surface
from cccd_paper.comparisons.baselines.surfaces import FAMILIES, Program
from cccd_paper.comparisons.isosurfaces import compare_isosurfaces
from cccd_paper.comparisons.thick_slices import thick_slice_experiment
from cccd_paper.settings import IsosurfaceSettings, ThickSliceSettings
from cccd_workflow.cohort import read_cohort

SOURCES, LETTERS = ("mni152", "phantom"), ("A", "H", "X")
METHODS = ("marching cubes", "surface nets", "signed distance + isosurface", *FAMILIES)


def score(structure) -> pd.DataFrame:
    """Measure every method on one structure, whole and from every n-th slice."""
    lofting = LoftSettings()
    surface = loft_surface(structure.sections(trace_contours(structure)), lofting)
    settings = IsosurfaceSettings(methods=METHODS)
    whole = compare_isosurfaces(structure, trace_contours(structure), surface, settings, lofting)
    tables = [whole.assign(slice_distance_mm=structure.frame.slice_spacing, every_nth=1)]
    if structure.organ not in LETTERS:
        tables.append(thick_slice_experiment(structure, ThickSliceSettings(), lofting))
    return pd.concat(tables).assign(case=structure.case, organ=structure.organ)


def main() -> None:
    """Score every structure and write ``docs/programs.csv``; rows are written as they come."""
    for program in FAMILIES.values():
        if isinstance(program, Program) and not program.available():
            print(f"No row of {program.title}: {program.package} is not there", file=sys.stderr)
    tables = []
    for row in read_cohort(ROOT / "config" / "cohort.tsv"):
        if row["source"] in SOURCES:
            asked = Request.of_row(row, ROOT / "config")
            structure = read_request(asked, ImportSettings(), seed=Settings().seed)
            tables.append(score(structure))
            print(tables[-1][["method", "chosen", "setting", "assd_mm", "genus", "seconds"]].to_string())
            columns = [*TABLES["thick_slices"], "triangles"]
            table = pd.concat(tables, ignore_index=True).reindex(columns=columns)
            table.to_csv(ROOT / "docs" / "programs.csv", index=False, float_format="%.4g")


if __name__ == "__main__":
    main()
