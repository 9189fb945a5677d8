"""The command ``cccd shapes``."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from cccd.errors import InputError
from cccd.store import check_writable
from cccd_shapes import files
from cccd_shapes.cohort import Cohort, aligned, fit_cohort
from cccd_shapes.series import fit_series
from cccd_shapes.statistics import compare_groups, likely_shapes, measure_model, principal_modes
from cccd_shapes.subjects import FEWEST, read_sheet, read_subject

__all__ = ["add_shapes"]

#: Control points of the template.
POINTS = 800
TOLERANCE = "largest distance (root mean square) of a fit to the subject's surface"
#: Permutations of who is of which group: p values down to .0005.
PERMUTATIONS = 1999
#: Subdivisions of the surface at whose points groups are compared.
COMPARED = 1


def add_shapes(command: argparse.ArgumentParser) -> None:
    """Fit one spline with the same quads to every subject of a cohort, and describe how shapes vary.

    The sheet is tab-separated, with columns name, and surface or mask; optionally label, mirrored, group, and
    time of the frames of one series. A call that was interrupted continues where it was.
    """
    add = command.add_argument
    add("sheet", type=Path, help="a row for each subject (.tsv)")
    add("-o", "--output", type=Path, required=True, metavar="FOLDER", help="of everything that is written")
    add("--points", type=int, default=POINTS, help="control points, about; default: %(default)s")
    add("--tolerance", type=float, metavar="MM", help=f"{TOLERANCE}; default: half a pixel")
    add("--without-size", action="store_true", help="make all subjects the same size before comparing them")
    add("--permutations", type=int, default=PERMUTATIONS, help="of the groups; default: %(default)s")
    add("--period", type=float, metavar="TIME", help="after which a series repeats; default: it does not")
    add("--processes", type=int, default=1, help="subjects that are fitted at once")
    add("--json", action="store_true", help="print JSON")
    command.set_defaults(run=_shapes)


def _shapes(given: argparse.Namespace) -> int:
    for name, least in (("points", 50), ("permutations", 19), ("processes", 1)):
        if getattr(given, name) < least:
            raise InputError(f"--{name}", f"{getattr(given, name)} is too few", f"give at least {least}")
    rows, folder = read_sheet(given.sheet), given.output
    if given.period is not None and (rows[0].time is None or given.period <= 0):
        raise InputError("--period", "it is of a series", "give a positive number, and a column time")
    check_writable(folder / "subjects.csv")
    subjects = [
        read_subject(row, folder / "surfaces") for row in tqdm(rows, "surfaces", leave=False, disable=None)
    ]
    cohort = fit_cohort(subjects, folder, given.points, given.tolerance, given.processes)
    made: dict[str, Any] = {"subjects": len(rows)}
    if rows[0].time is not None:
        cohort, series = fit_series(cohort, given.period)
        files.write_series(folder, series)
        made["ejection_fraction"], *made["ejection_fraction_interval"] = series.ejection.tolist()
    files.write_subjects(folder / "subjects.csv", cohort)
    used = [cohort.fits[number] for number in cohort.used]
    shapes = aligned(np.array([fit.spline.vertices for fit in used]), cohort.template, given.without_size)
    files.write_fits(folder, cohort, shapes)
    likely = likely_shapes(shapes, cohort.doubts)
    model = principal_modes(likely, cohort.template.metric)
    crossing = files.write_model(folder, cohort, model, measure_model(model))
    files.write_scores(folder / "scores.csv", cohort, model)
    made |= {"fit": len(used), "control_points": len(model.mean)}
    made["modes_of_90_percent"] = 1 + int((model.compactness < 0.9).sum())
    made["warnings"] = [*_doubts(cohort), *crossing]
    groups = [cohort.subjects[number].row.group for number in cohort.used]
    if min(map(groups.count, set(groups))) >= FEWEST and len(set(groups)) > 1:
        sampler = cohort.template.spline.sampler(COMPARED)
        points = np.array([sampler.matrix @ shape for shape in likely])
        test = compare_groups(model, points, groups, given.permutations)
        mean = cohort.template.spline.moved(model.mean).tessellate(COMPARED)
        files.write_groups(folder / "groups.vtp", mean, test)
        made |= {"p": test.p, "modes_tested": test.modes, "p_points_least": float(test.p_points.min())}
    elif len(set(groups)) > 1:
        made["warnings"].append(f"groups are not compared: one has fewer than {FEWEST} subjects that fit")
    _say(given, made)
    return 0


def _doubts(cohort: Cohort) -> list[str]:
    """Return what was mended, and who does not fit."""
    found = [f"{subject.name}: {note}" for subject in cohort.subjects for note in subject.notes]
    told = zip(cohort.subjects, cohort.problems, strict=True)
    return found + [f"{subject.name} does not fit: {problem}" for subject, problem in told if problem]


def _say(given: argparse.Namespace, made: dict[str, Any]) -> None:
    """Print what was made."""
    if given.json:
        print(json.dumps({"output": str(given.output), **made}, indent=2))
        return
    print(given.output)
    print(f"  {made['fit']} of {made['subjects']} subjects fit, {made['control_points']} control points")
    print(f"  {made['modes_of_90_percent']} modes have 90 % of the variance")
    if "ejection_fraction" in made:
        low, high = made["ejection_fraction_interval"]
        print(f"  ejection fraction {made['ejection_fraction']:.3f} ({low:.3f} to {high:.3f})")
    if "p" in made:
        print(f"  groups: p = {made['p']:.4g} ({made['modes_tested']} modes), ", end="")
        print(f"least p of a point, corrected for all: {made['p_points_least']:.4g}")
    for warning in made["warnings"]:
        print(f"warning: {warning}", file=sys.stderr)
