"""From fits to what is written: mean and modes, scores, and whether groups differ."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from cccd.store import write_json
from cccd_labels.progress import joined_warnings
from cccd_shapes import FEWEST, files
from cccd_shapes.cohort import Cohort, aligned
from cccd_shapes.series import fit_series
from cccd_shapes.statistics import compare_groups, principal_modes

#: Permutations of who is of which group: p values down to .0005.
PERMUTATIONS = 1999
#: What an earlier call, perhaps of other subjects, may have left in the folder.
REMADE = ("fitted/*/surface.*", "modes/*/surface.*", "particles/*.particles", "groups.vtp", "series.*")
#: Subdivisions of the surface at whose points groups are compared.
COMPARED = 1


def describe(
    cohort: Cohort,
    folder: Path,
    without_size: bool = False,
    permutations: int = PERMUTATIONS,
    period: float | None = None,
) -> dict[str, Any]:
    """Write a cohort's model (docs/gallery/shapes.md lists the files); return what ``summary.json`` has.

    Subjects with times are frames of one series, which repeats after the ``period``. Groups are compared by
    so many ``permutations``, where each has three subjects that fit.
    """
    made: dict[str, Any] = {"subjects": len(cohort.subjects)}
    for old in (
        found for name in REMADE for found in folder.glob(name)
    ):  # another sheet's subjects among them
        old.unlink()
    if cohort.subjects[0].row.time is not None:
        cohort, series = fit_series(cohort, period)
        files.write_series(folder, series)
        made["ejection_fraction"], *made["ejection_fraction_interval"] = series.ejection.tolist()
    files.write_subjects(folder / "subjects.csv", cohort)
    shapes = aligned(cohort.shapes, cohort.template, without_size)
    files.write_fits(folder, cohort, shapes)
    model = principal_modes(shapes, cohort.template.metric)
    files.write_scores(folder / "scores.csv", cohort, model)
    made |= {"fit": len(shapes), "control_points": len(model.mean), "warnings": _doubts(cohort)}
    made["modes_of_90_percent"] = 1 + int((model.compactness < 0.9).sum())
    groups = [cohort.subjects[number].row.group for number in cohort.used]
    counts = Counter(groups)
    if all(counts) and len(counts) > 1 and min(counts.values()) >= FEWEST:
        sampler = cohort.template.spline.sampler(COMPARED)
        points = np.array([sampler.matrix @ shape for shape in shapes])
        test = compare_groups(model, points, groups, permutations)
        mean = cohort.template.spline.moved(model.mean).tessellate(COMPARED)
        files.write_groups(folder / "groups.vtp", mean, test)
        made |= {"p": test.p, "modes_tested": test.modes, "p_points_least": float(test.p_points.min())}
    elif any(counts):
        sizes = ", ".join(f"{name or 'no group'}: {count}" for name, count in counts.items())
        made["warnings"].append(f"groups are not compared ({sizes}): it takes two, each of {FEWEST} that fit")
    made["warnings"] += files.write_model(folder, cohort, model, made)
    write_json(folder / "summary.json", made)
    return made


def _doubts(cohort: Cohort) -> list[str]:
    """Return what was mended, and who does not fit."""
    found = joined_warnings({subject.name: subject.notes for subject in cohort.subjects}, "subjects")
    fits = zip(cohort.subjects, cohort.problems, strict=True)
    return found + [f"{subject.name} does not fit: {problem}" for subject, problem in fits if problem]
