"""The commands ``cccd compare``, ``run``, ``report``, ``export`` and ``next``."""

from __future__ import annotations

import argparse
import json
import os
import sys
from pathlib import Path

from cccd.commands import add_band, add_input, check_files, read_given
from cccd.errors import InputError
from cccd.store import check_writable


def add_compare(command: argparse.ArgumentParser) -> None:
    """Measure how far two surfaces, masks or label maps agree, label by label.

    Inputs: meshes (PLY, STL, OBJ, GLB, VTP, GIfTI), surface.h5, solids (STEP, IGES, BREP), masks,
    label maps, DICOM SEG and RTSTRUCT. Exits with 1 if a limit is missed.
    """
    from cccd_workflow.limits import LIMITS, TOLERANCE_MM

    command.add_argument("first", type=Path, metavar="A")
    command.add_argument("second", type=Path, metavar="B")
    command.add_argument(
        "--label", action="append", default=[], metavar="LABEL",
        help="compare only this label; if A and B use different labels, give both, that of A first",
    )  # fmt: skip
    command.add_argument(
        "--tolerance", type=float, default=TOLERANCE_MM, metavar="MM",
        help=f"surfaces this near to each other agree, for the surface Dice; default: {TOLERANCE_MM:g} mm",
    )  # fmt: skip
    command.add_argument(
        "-o", "--output", type=Path, action="append", default=[], metavar="FILE",
        help="output file, repeatable: .glb, .vtp: A's surface coloured by its distance to B; .html: a page",
    )  # fmt: skip
    for figure, limit in LIMITS.items():
        about = f"exit with 1 if {limit.missed}"
        command.add_argument(f"--{limit.option}", type=float, dest=figure, metavar=limit.unit, help=about)
    command.add_argument("--json", action="store_true", help="print JSON")
    command.set_defaults(run=_compare)


def add_run(command: argparse.ArgumentParser) -> None:
    """Run the workflow on a cohort sheet or on the masks of a BIDS data set.

    Arguments after -- go to Snakemake: -- surfaces, -- results/anna/liver/surface.ply, -- --config
    seed=7
    """
    command.add_argument("input", type=Path, help="cohort sheet (.tsv), or the folder of a BIDS data set")
    command.add_argument("output", type=Path, nargs="?", help="BIDS: folder of the results")
    command.add_argument("level", nargs="?", choices=["participant"], help="BIDS: the level of the analysis")
    command.add_argument(
        "--participant-label", nargs="+", default=[], metavar="LABEL", help="BIDS: only these participants"
    )
    command.add_argument(
        "--cores", type=int, default=os.cpu_count() or 1, help="jobs at once; default: all cores"
    )
    command.add_argument("--directory", type=Path, help="folder for results/; default: this folder")
    command.add_argument("--profile", help="slurm, generic, or the folder of a Snakemake profile")
    command.add_argument(
        "--configfile", type=Path, metavar="YAML", help="your own settings, for example 'compare: true'"
    )
    command.add_argument(
        "-k", "--keep-going", action="store_true", help="finish the other structures where one fails"
    )
    command.add_argument("-n", "--dry-run", action="store_true", help="show what would run, and run nothing")
    command.set_defaults(run=_run)


def add_export(command: argparse.ArgumentParser) -> None:
    """Write a finished structure of the workflow in another format."""
    command.add_argument("input", type=Path, help="folder of a finished structure: results/CASE/ORGAN")
    command.add_argument(
        "-o", "--output", type=Path, action="append", required=True, metavar="FILE",
        help="output file, repeatable; the suffix chooses the format, as in cccd surface",
    )  # fmt: skip
    add_band(command)
    command.set_defaults(run=_export)


def add_report(command: argparse.ArgumentParser) -> None:
    """Build the report of all finished structures again."""
    command.add_argument(
        "input",
        type=Path,
        nargs="?",
        default=Path("results"),
        help="folder of the results; default: results",
    )
    command.add_argument(
        "-o", "--output", type=Path, metavar="HTML", help="the page; default: report.html in that folder"
    )
    command.set_defaults(run=_report)


def add_next(command: argparse.ArgumentParser) -> None:
    """Name the slice in the middle of the widest gap of a partly annotated mask."""
    add_input(command)
    command.set_defaults(run=_next)


def _compare(given: argparse.Namespace) -> int:
    from cccd_workflow.comparison import compare, missed_limits
    from cccd_workflow.comparison_files import check_outputs, write_comparison
    from cccd_workflow.limits import LIMITS

    if len(given.label) > 2:
        raise InputError("--label", "given more than twice", "give one label, or that of A and that of B")
    if not given.tolerance >= 0:
        raise InputError("--tolerance", f"{given.tolerance:g} is no distance", "give mm, 0 or more")
    check_outputs(given.output)
    check_files(given.output, [given.first, given.second])
    limits = {figure: value for figure in LIMITS if (value := getattr(given, figure)) is not None}
    found = compare(given.first, given.second, given.label, given.tolerance, bool(given.output))
    for path in given.output:
        write_comparison(path, found)
    missed = missed_limits(found, limits)
    if given.json:
        print(json.dumps({**found.as_json(), "limits": limits, "missed": missed}, indent=2))
    else:
        print(found)
        for line in missed:
            print(f"missed: {line}")
        print(*given.output, sep="\n", end="\n" * bool(given.output))
    return 1 if missed else 0


def _run(given: argparse.Namespace) -> int:
    from cccd_workflow.workflow_command import run_command, snakemake_command

    sheet, folder = given.input, given.directory or Path.cwd()
    if sheet.is_dir():
        sheet, folder = _sheet_of_bids(given)
    elif given.output is not None:
        raise InputError(
            str(sheet), "not the folder of a BIDS data set", "give BIDS_DIR OUT participant, or a sheet"
        )
    check_writable(folder / "results")
    flags = [flag for flag in ("--keep-going", "--dry-run") if getattr(given, flag[2:].replace("-", "_"))]
    further = [*flags, *given.further]
    command = snakemake_command(sheet, folder, given.cores, given.profile, given.configfile, further)
    sys.stdout.flush()
    return run_command(command)


def _sheet_of_bids(given: argparse.Namespace) -> tuple[Path, Path]:
    """Write the cohort sheet of a BIDS data set into the folder of the results."""
    import cccd
    from cccd_workflow.bids import find_structures, write_sheet

    if given.output is None or given.level is None:
        raise InputError(
            str(given.input), "a folder", "give BIDS_DIR OUT participant, or a cohort sheet (.tsv)"
        )
    check_writable(given.output / "cohort.tsv")
    rows = find_structures(given.input, cccd.labels, given.participant_label)
    sheet = given.output / "cohort.tsv"
    write_sheet(sheet, rows)
    print(f"{sheet}: {len(rows)} structures of {len({row['case'] for row in rows})} cases")
    return sheet, given.output


def _report(given: argparse.Namespace) -> int:
    from cccd.project import PROJECT
    from cccd.settings.root import whole_settings
    from cccd_workflow.report.page import build_report_of_finished

    output = given.output or given.input / "report.html"
    check_writable(output)
    if not any(given.input.glob("*/*/metrics.json")):
        raise InputError(str(given.input), "no structure is finished there", "give the folder of the results")
    templates = PROJECT / "workflow" / "report"
    build_report_of_finished(given.input, whole_settings()().as_config(), output, templates)
    print(output)
    return 0


def _export(given: argparse.Namespace) -> int:
    from cccd.commands import check_outputs, with_name
    from cccd.files import ExportOptions, write_surface
    from cccd.store import read_drawn
    from cccd.surface.surface import read_surface

    folder = given.input.parent if given.input.is_file() else given.input  # a file of it will do
    splines, mesh = folder / "surface.h5", folder / "surface.ply"
    for path in (splines, mesh):
        if not path.is_file():
            raise InputError(
                str(path), "not there", "give the folder of a finished structure: results/CASE/ORGAN"
            )
    check_outputs(given.output, [mesh])
    surface, structure = read_surface(splines, mesh), folder / "structure.h5"
    drawn = read_drawn(structure) if structure.is_file() else None
    for path in given.output:
        sides = surface.sides() if given.band else {}
        moved = {with_name(path, side): of for side, of in sides.items()}
        for file, one in {path: surface, **moved}.items():
            write_surface(file, one, ExportOptions(folder.resolve().name, drawn=drawn))
            print(file)
    return 0


def _next(given: argparse.Namespace) -> int:
    from cccd.settings.root import Settings

    structure = read_given(given, Settings())
    gaps = [] if structure.annotation is None else structure.annotation.gaps
    if not gaps:
        problem = "no slice is left to draw between those that are annotated"
        raise InputError(structure.organ, problem, "give a mask of some slices, or --annotated nonempty")
    axis = structure.frame.slice_axis
    if given.json:
        slices = [{"slice": number, "gap": gap} for number, gap in gaps]
        print(json.dumps({"input": str(given.input), "axis": axis, "slices": slices}, indent=2))
        return 0
    number, gap = gaps[0]
    print(f"annotate slice {number} next (axis {axis}, counted from 0), in the middle of {gap} that are not")
    return 0
