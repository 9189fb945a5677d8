"""The command ``cccd calibrate``."""

from __future__ import annotations

import argparse
from pathlib import Path

from tqdm import tqdm

import cccd
from cccd.bands import Calibration, Reader
from cccd.commands import check_files
from cccd.errors import InputError
from cccd.inputs import Request, read_request
from cccd.settings.root import Settings
from cccd.store import atomic_path
from cccd_calibration.readers import Pair, calibrate_readers, compare_readers, read_pairs
from cccd_calibration.thinning import calibrate_masks
from cccd_workflow.cohort import read_cohort


def add_calibrate(command: argparse.ArgumentParser) -> None:
    """Thin dense masks, loft them, and find by how much the error bands must be widened.

    Use the result as surface: {calibration: FILE}. With --readers, find how far two readers' borders lie
    apart; use that as surface: {reader_mm: FILE}, or --reader FILE.
    """
    command.add_argument(
        "input", type=Path, nargs="?", help="cohort sheet (.tsv) of masks that have every slice"
    )
    command.add_argument(
        "--readers", type=Path, metavar="TSV",
        help="masks of the same organs by two readers: columns first, second and, if wanted, organ and label",
    )  # fmt: skip
    command.add_argument(
        "-o", "--output", type=Path, default=Path("calibration.json"), metavar="JSON",
        help="default: calibration.json in this folder",
    )  # fmt: skip
    command.set_defaults(run=_calibrate)


def _calibrate(given: argparse.Namespace) -> int:
    if (given.input is None) == (given.readers is None):
        raise InputError("cccd calibrate", "one table is needed", "give a cohort sheet, or --readers PAIRS")
    check_files([given.output], [given.input or given.readers])
    settings = Settings()
    found = _of_readers(given.readers, settings) if given.readers else _of_masks(given.input, settings)
    with atomic_path(given.output) as temporary:
        found[0].write(temporary)
    print(given.output, f"  {found[0].made_of}", *found[1], sep="\n")
    return 0


def _of_masks(sheet: Path, settings: Settings) -> tuple[Calibration, list[str]]:
    rows = [Request.of_row(row, sheet.parent) for row in read_cohort(sheet)]
    structures = (read_request(row, settings.import_, settings.seed) for row in rows)
    with tqdm(structures, total=len(rows), disable=None, leave=False) as bar:
        calibration = calibrate_masks(bar, len(rows), settings, sheet.name)
    return calibration, [
        f"  slices {one.low:g} to {one.high:g} pixels apart: {one.stacks} stacks of {one.organs} organs"
        for one in calibration.regimes
    ]


def _of_readers(table: Path, settings: Settings) -> tuple[Reader, list[str]]:
    pairs: list[Pair] = []
    for row in tqdm(read_pairs(table), disable=None, leave=False):
        try:
            first, second = (cccd.read(table.parent / name, row.label) for name in (row.first, row.second))
            pairs.append(compare_readers(first, second, settings, row.name))
        except InputError as error:
            raise error.at(row.where) from None
    reader = calibrate_readers(pairs, settings.surface.band, table.name)
    width, _ = reader.at(settings.surface.band)
    return reader, [
        f"  {settings.surface.band:.0%} of another reader's border: within {width:.2f} mm of its band"
    ]
