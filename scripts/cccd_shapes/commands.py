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
from cccd_shapes.cohort import aligned, fit_cohort
from cccd_shapes.files import write_fits, write_groups, write_model, write_scores, write_subjects
from cccd_shapes.statistics import compare_groups, measure_model, principal_modes
from cccd_shapes.subjects import FEWEST, read_sheet, read_subject

__all__ = ["add_shapes"]

#: Control points of the template.
POINTS = 800
#: Permutations of who is of which group: p values down to .0005.
PERMUTATIONS = 1999
#: Subdivisions of the surface at whose points groups are compared.
COMPARED = 1


def add_shapes(command: argparse.ArgumentParser) -> None:
    """Fit one spline with the same quads to every subject of a cohort, and describe how shapes vary.

    The sheet is tab-separated, with columns name, and surface or mask; optionally label, mirrored, group. A
    call that was interrupted continues where it was.
    """
    command.add_argument("sheet", type=Path, help="a row for each subject (.tsv)")
    command.add_argument(
        "-o", "--output", type=Path, required=True, metavar="FOLDER", help="of everything that is written"
    )
    command.add_argument(
        "--points", type=int, default=POINTS, help="control points, about; default: %(default)s"
    )
    command.add_argument(
        "--tolerance", type=float, metavar="MM",
        help="largest distance (root mean square) of a fit to the subject's surface; default: half a pixel",
    )  # fmt: skip
    command.add_argument(
        "--without-size", action="store_true", help="make all subjects the same size before they are compared"
    )
    command.add_argument(
        "--permutations", type=int, default=PERMUTATIONS, help="of the groups; default: %(default)s"
    )
    command.add_argument("--processes", type=int, default=1, help="subjects that are fitted at once")
    command.add_argument("--json", action="store_true", help="print JSON")
    command.set_defaults(run=_shapes)


def _shapes(given: argparse.Namespace) -> int:
    for name, least in (("points", 50), ("permutations", 19), ("processes", 1)):
        if getattr(given, name) < least:
            raise InputError(f"--{name}", f"{getattr(given, name)} is too few", f"give at least {least}")
    rows, folder = read_sheet(given.sheet), given.output
    check_writable(folder / "subjects.csv")
    subjects = [
        read_subject(row, folder / "surfaces") for row in tqdm(rows, "surfaces", leave=False, disable=None)
    ]
    cohort = fit_cohort(subjects, folder, given.points, given.tolerance, given.processes)
    write_subjects(folder / "subjects.csv", cohort)
    used = [cohort.fits[number] for number in cohort.used]
    shapes = aligned(np.array([fit.spline.vertices for fit in used]), cohort.template, given.without_size)
    model = principal_modes(shapes, cohort.template.metric)
    warnings = [f"{subject.name}: {note}" for subject in cohort.subjects for note in subject.notes]
    warnings += [
        f"{subject.name} does not fit: {problem}"
        for subject, problem in zip(cohort.subjects, cohort.problems, strict=True)
        if problem
    ]
    write_fits(folder, cohort, shapes)
    warnings += write_model(folder, cohort, model, measure_model(model))
    write_scores(folder / "scores.csv", cohort, model)
    groups = [cohort.subjects[number].row.group for number in cohort.used]
    made = {
        "subjects": len(rows),
        "fit": len(used),
        "control_points": len(model.mean),
        "modes_of_90_percent": 1 + int((model.compactness < 0.9).sum()),
        "warnings": warnings,
    }
    if min(map(groups.count, set(groups))) >= FEWEST and len(set(groups)) > 1:
        sampler = cohort.template.spline.sampler(COMPARED)
        points = np.array([sampler.matrix @ shape for shape in shapes])
        test = compare_groups(model, points, groups, given.permutations)
        write_groups(
            folder / "groups.vtp", cohort.template.spline.moved(model.mean).tessellate(COMPARED), test
        )
        made |= {"p": test.p, "modes_tested": test.modes, "p_points_least": float(test.p_points.min())}
    elif len(set(groups)) > 1:
        warnings.append(f"groups are not compared: one has fewer than {FEWEST} subjects that fit")
    _say(given, made)
    return 0


def _say(given: argparse.Namespace, made: dict[str, object]) -> None:
    """Print what was made."""
    if given.json:
        print(json.dumps({"output": str(given.output), **made}, indent=2))
        return
    print(given.output)
    print(f"  {made['fit']} of {made['subjects']} subjects fit, {made['control_points']} control points")
    print(f"  {made['modes_of_90_percent']} modes have 90 % of the variance")
    if "p" in made:
        print(f"  groups: p = {made['p']:.4g} ({made['modes_tested']} modes), ", end="")
        print(f"least p of a point, corrected for all: {made['p_points_least']:.4g}")
    warnings = made["warnings"]
    assert isinstance(warnings, list)
    for warning in warnings:
        print(f"warning: {warning}", file=sys.stderr)
