"""The command ``cccd check``."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np
from nibabel.orientations import aff2axcodes

from cccd.commands import add_input, check_files, read_given
from cccd.console import print_error
from cccd.containers import Structure
from cccd.errors import InputError
from cccd.inputs import Request, read_request
from cccd.inputs.row_files import reading_once
from cccd.settings.root import Settings
from cccd.store import atomic_path, check_writable
from cccd_labels.label_survey import SurveyedLabel, measure_labels, survey_labels
from cccd_viewers.regions import DrawnLabels, draw_region
from cccd_workflow.cohort import read_cohort

#: What nibabel's letters of the axes stand for.
_TOWARDS = {"R": "right", "L": "left", "A": "anterior", "P": "posterior", "S": "superior", "I": "inferior"}


def add_check(command: argparse.ArgumentParser) -> None:
    """Read the input, report how it was understood (grid, axes, spacing, labels, cut ends), and draw it.

    A cohort sheet (.tsv) is read row by row.
    """
    add_input(command)
    command.add_argument(
        "-o", "--output", type=Path, metavar="PNG",
        help="the picture; default: NAME_check.png in this folder, "
        "of a sheet's rows in the folder SHEET_check",
    )  # fmt: skip
    command.set_defaults(run=_check)


def _check(given: argparse.Namespace) -> int:
    from_image = bool(given.seed) or given.threshold is not None
    if given.output is not None:
        if given.output.suffix.lower() != ".png":
            raise InputError(str(given.output), "the picture is a PNG", "end its name with .png")
        check_files([given.output], [given.input, given.image])
    if given.input.suffix == ".tsv":
        return _check_sheet(given)
    if given.label or given.boundary or from_image or not given.input.exists():
        structure = read_given(given, Settings())
        measured = [] if given.boundary or from_image else measure_labels(given.input)
        found = [_check_one(given, structure, [label for label, _ in measured])]
    else:
        found = [_check_one(given, *survey_labels(given.input, given.image, given.annotated))]
    if given.json:
        print(json.dumps(found, indent=2))
    return 0


def _check_sheet(given: argparse.Namespace) -> int:
    """Check every row of a cohort sheet; what cannot be read is said in a line for each row."""
    sheet: Path = given.input
    rows = read_cohort(sheet)
    if given.output is not None and len(rows) > 1:
        raise InputError(str(given.output), "each row has a picture of its own", "leave --output out")
    found: list[dict[str, Any]] = []
    failed = False
    for _, alike in groupby(rows, key=itemgetter("image", "mask")):
        files = reading_once()
        for row in alike:
            try:
                found.append(_check_one(given, *_survey_row(row, sheet.parent, files)))
            except InputError as error:
                failed = True
                print_error(str(error))
    if given.json:
        print(json.dumps(found, indent=2))
    return int(failed)


def _survey_row(
    row: Mapping[str, str], folder: Path, files: Callable[..., Any]
) -> tuple[Structure, Sequence[SurveyedLabel], DrawnLabels | None]:
    """Read a row's structure, or all labels of a map whose organ is ``*``."""
    if row["organ"] != "*":
        settings = Settings()
        return read_request(Request.of_row(row, folder), settings.import_, settings.seed, files), (), None
    image, table = (folder / row[column] if row[column] else None for column in ("image", "labels"))
    try:
        structure, labels, drawn = survey_labels(folder / row["mask"], image, row["annotated"], table)
    except InputError as error:
        raise error.at(row["location"]) from None
    return replace(structure, case=row["case"], organ=row["case"]), labels, drawn


def _check_one(
    given: argparse.Namespace,
    structure: Structure,
    labels: Sequence[SurveyedLabel] = (),
    drawn: DrawnLabels | None = None,
) -> dict[str, Any]:
    """Say what a structure was understood to be, and draw it."""
    name = structure.organ if structure.organ == structure.case else f"{structure.case}_{structure.organ}"
    picture = given.output or Path(f"{name}_check.png")
    said = _describe_structure(structure, drawn)
    if given.input.suffix == ".tsv":
        picture = given.output or Path(f"{given.input.stem}_check") / f"{name}.png"  # one of many
        said = {"case": structure.case, **said}
    check_writable(picture)
    if not given.json:
        for key, value in {**said, "labels": labels}.items():
            for line in [value] if isinstance(value, str) else value:
                print(f"{key + ':':<10} {line}")
    said["labels"] = [
        {"label": label.label, "name": label.name, "volume_ml": label.volume_ml, "note": label.note}
        for label in labels
    ]
    with atomic_path(picture) as temporary:
        draw_region(structure, temporary, drawn)
    if not given.json:
        print(f"{'picture:':<10} {picture}")
    return {**said, "picture": str(picture)}


def _describe_structure(structure: Structure, drawn: DrawnLabels | None) -> dict[str, Any]:
    frame = structure.frame
    axes = [str(code) for code in aff2axcodes(frame.affine)]
    along = f"axis {frame.slice_axis} ({axes[frame.slice_axis]})"
    tilted = f", tilted by {frame.tilt:.1f} degrees" if frame.is_tilted else ""
    slices = _slices(structure)
    steps = sorted({f"{step * frame.slice_spacing:.4g}" for step in np.diff(slices)}, key=float)
    apart = " to ".join(dict.fromkeys((steps[0], steps[-1]))) if steps else f"{frame.slice_spacing:.4g}"
    shape, spacing = " x ".join(map(str, frame.shape)), " x ".join(f"{size:.4g}" for size in frame.spacing)
    ways = {
        "contours": "drawn contours, used as they are",
        "boundary": "boundary maps, ordered by the network",
        "probability": "probabilities, traced at 0.5",
    }
    traced = "a region of grey values, traced" if "region" in structure.provenance else "a mask, traced"
    way = next((text for name, text in ways.items() if getattr(structure, name) is not None), traced)
    if drawn is not None:
        way = way.replace("a mask", "masks")
        way += f"; {len(drawn.captions)} labels: --label NAME takes one, --all-labels makes each"
    return {
        "organ": structure.organ,
        "input": way,
        "grid": f"{shape} voxels of {spacing} mm",
        "axes": f"index axes run towards {', '.join(axes)}: {', '.join(_TOWARDS[axis] for axis in axes)}",
        "slices": f"{len(slices)} with organ, along {along}, {apart} mm apart" + tilted,
        "warnings": list(structure.warnings),
    }


def _slices(structure: Structure) -> list[int]:
    """Numbers of the slices with organ, ascending."""
    if structure.contours is not None:
        return sorted(set(structure.contours.slice.tolist()))
    stack = structure.required_stack(structure.input)
    return np.flatnonzero(stack.any(axis=(1, 2))).tolist()
