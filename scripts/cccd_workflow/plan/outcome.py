"""The last lines of a run: where its results are, or what failed and what is finished all the same."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from pathlib import Path

from cccd_workflow.job import INTERRUPTED
from cccd_workflow.plan.cohort import StructureName
from cccd_workflow.plan.plan import OF_NO_CASE, Plan

_REPORT = Path("results") / "report.html"


def failures(plan: Plan) -> list[str]:
    """Return the one-line errors of rows without files, and those that failed jobs left beside their logs.

    Those of structures that the sheet does not name any more are left out. They are sorted.
    """
    cohort = plan.cohort
    files = [file for file in Path("logs").rglob("*.failed") if _is_of(file, plan)]
    lines = {line for file in files for line in file.read_text(encoding="utf-8").splitlines()}
    return sorted(lines | {f"{'/'.join(name)}: {error}" for name, error in cohort.missing.items()})


def _is_of(file: Path, plan: Plan) -> bool:
    """Whether a job's file belongs to a structure or a case of the sheet, or to neither."""
    match file.parts[1:]:
        case (folder, *_) if folder in OF_NO_CASE:
            return True
        case (case, _):
            return any(name.case == case for name in plan.cohort.rows)
        case (case, organ, *_):
            return StructureName(case, organ) in plan.cohort.rows
        case _:
            return True


def report_good_run(plan: Plan, models: Iterable[str] = ()) -> None:
    """Print where the results are: report, surfaces, and last the pages of shape models, if asked for."""
    for file in map(Path, (_REPORT, *plan.files("surface.ply"), *models)):
        if file.exists():
            print(file.resolve())


def report_interrupted_run(plan: Plan) -> None:
    """Print what failed before the run was asked to end, and how far it came."""
    lines = [line for line in failures(plan) if not line.endswith(f": {INTERRUPTED}")]
    _print_failures(lines)
    finals = plan.files("surface.ply")
    done = sum(Path(file).exists() for file in finals)
    came = f"Interrupted: {done} of {len(finals)} structures are finished."
    print(came, "Run the same command again to continue.", file=sys.stderr)


def _print_failures(lines: list[str]) -> None:
    if lines:
        print(f"\n{len(lines)} failed:", *lines, sep="\n  ", file=sys.stderr)


def report_failed_run(plan: Plan) -> None:
    """Print every failure in one line, and write a report of the structures that are finished."""
    lines = failures(plan)
    _print_failures(lines)
    if any(Path(file).exists() for file in plan.files("metrics.json")):
        from cccd_workflow.report.page import build_report_of_finished  # slow, and most runs need none

        build_report_of_finished(
            _REPORT.parent,
            plan.config,
            _REPORT,
            plan.root / "workflow" / "report",
            structures=plan.cohort.reconstructed,
            failures=lines,
            benchmarks=Path("benchmarks"),
        )
        print(f"\nReport of the finished structures: {_REPORT.resolve()}", file=sys.stderr)
    hint = "Fix the input and run the same command again: finished files are kept"
    silent = [name for name in plan.cohort.reconstructed if "/".join(name) not in "\n".join(lines)]
    waiting = any(not Path("results", *name, "metrics.json").exists() for name in silent)
    if waiting and len(lines) > len(plan.cohort.missing):  # a job failed
        hint += " (add --keep-going to finish the other structures first)"
    print(f"\n{hint}.", file=sys.stderr)
