"""The commands ``cccd next`` and ``cccd calibrate``: for masks that are annotated in part."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from tqdm import tqdm

import cccd
from cccd.cohort import read_cohort
from cccd.commands.arguments import add_input
from cccd.commands.outputs import check_files
from cccd.console import clock
from cccd.inputs import load_structure
from cccd.next_slice import rank_slices
from cccd.settings.root import Settings
from cccd.store import atomic_path
from cccd.thinning import calibrate_masks

__all__ = ["add_calibrate", "add_next"]


def add_next(command: argparse.ArgumentParser) -> None:
    """Rank the slices of a partly annotated mask by how much one more lowers the surface's error."""
    add_input(command)
    command.set_defaults(run=_next)


def add_calibrate(command: argparse.ArgumentParser) -> None:
    """Thin dense masks, loft them, and find by how much the error bands must be widened.

    Use the result as surface: {calibration: FILE}.
    """
    command.add_argument("input", type=Path, help="cohort sheet (.tsv) of masks that have every slice")
    command.add_argument(
        "-o", "--output", type=Path, default=Path("calibration.json"), metavar="JSON",
        help="default: calibration.json in this folder",
    )  # fmt: skip
    command.set_defaults(run=_calibrate)


def _next(given: argparse.Namespace) -> int:
    of = {"image": given.image, "boundary": given.boundary, "annotated": given.annotated}
    with clock("slices"):
        structure = cccd.read(given.input, given.label, **of)
        gains = rank_slices(structure, Settings())
    if given.json:
        slices = [{"slice": gain.slice, "lowers_error": round(gain.lowers, 4)} for gain in gains]
        axis = structure.frame.slice_axis
        print(json.dumps({"input": str(given.input), "axis": axis, "slices": slices}, indent=2))
        return 0
    best, *others = gains[:4]
    print(f"annotate slice {best.slice} next (axis {structure.frame.slice_axis}, counted from 0):")
    print(f"  it is expected to lower the error by {best.lowers:.1%}")
    for gain in others:
        print(f"  slice {gain.slice}: {gain.lowers:.1%}")
    return 0


def _calibrate(given: argparse.Namespace) -> int:

    check_files([given.output], [given.input])
    settings, rows = Settings(), read_cohort(given.input)
    structures = (load_structure(row, given.input.parent, settings.import_, settings.seed) for row in rows)
    with tqdm(structures, total=len(rows), disable=None, leave=False) as bar:
        calibration = calibrate_masks(bar, len(rows), settings, given.input.name)
    with atomic_path(given.output) as temporary:
        calibration.write(temporary)
    print(given.output)
    print(f"  {calibration.made_of}")
    for regime in calibration.regimes:
        apart = f"slices {regime.low:g} to {regime.high:g} pixels apart"
        print(f"  {apart}: {regime.stacks} stacks of {regime.organs} organs")
    return 0
