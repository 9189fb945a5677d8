"""The command ``cccd shapes``."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

import numpy as np
from tqdm import tqdm

from cccd.errors import InputError
from cccd.store import check_writable
from cccd_shapes import POINTS
from cccd_shapes.cohort import fit_cohort
from cccd_shapes.model import PERMUTATIONS, describe
from cccd_shapes.series import time_basis
from cccd_shapes.subjects import read_sheet, read_subject

#: The least that options may be.
LEAST = {"points": 50, "permutations": 19, "processes": 1, "tolerance": 1e-3, "period": 1e-6}


def add_shapes(command: argparse.ArgumentParser) -> None:
    """Fit one spline with the same quads to every subject of a cohort, and describe how shapes vary.

    The sheet is tab-separated, with columns name, and surface or mask; optionally label, mirrored, group, and
    time of the frames of one series. A call that was interrupted continues where it was.
    """
    add = command.add_argument
    add("sheet", type=Path, help="a row for each subject (.tsv)")
    add("-o", "--output", type=Path, required=True, metavar="FOLDER", help="of everything that is written")
    add("--points", type=int, default=POINTS, help="control points, about; default: %(default)s")
    add("--tolerance", type=float, metavar="MM", help="largest rms distance of a fit; default: half a pixel")
    add("--without-size", action="store_true", help="make all subjects the same size before comparing them")
    add("--permutations", type=int, default=PERMUTATIONS, help="of the groups; default: %(default)s")
    add("--period", type=float, metavar="TIME", help="after which a series repeats; default: it does not")
    add("--processes", type=int, default=1, help="subjects that are fitted at once")
    add("--json", action="store_true", help="print JSON")
    command.set_defaults(run=_shapes)


def _shapes(given: argparse.Namespace) -> int:
    for name, least in LEAST.items():
        if (value := getattr(given, name)) is not None and not least <= value < np.inf:
            raise InputError(f"--{name}", f"it is {value:g}", f"give a number of at least {least:g}")
    rows, folder = read_sheet(given.sheet), given.output
    if rows[0].time is not None:  # what a series lacks is said before the work
        time_basis(np.array([row.time for row in rows], float), given.period, given.sheet.name)
    elif given.period is not None:
        raise InputError("--period", "it is of a series", "give the sheet a column time")
    check_writable(folder / "subjects.csv")
    shown = tqdm(rows, "surfaces", leave=False, disable=None)
    subjects = [read_subject(row, folder / "surfaces", given.tolerance) for row in shown]
    cohort = fit_cohort(subjects, folder, given.points, given.processes)
    made = describe(cohort, folder, given.without_size, given.permutations, given.period)
    if given.json:
        print(json.dumps({"output": str(folder), **made}, indent=2))
        return 0
    print(folder)
    for name in [name for name in made if name != "warnings"]:
        values = ", ".join(f"{value:.4g}" for value in np.atleast_1d(made[name]))
        print(f"  {name.replace('_', ' ')}: {values}")
    for warning in made["warnings"]:
        print(f"warning: {warning}", file=sys.stderr)
    return 0
